# sv_tree_draw: what draws trees by OSMesa.
add_library(sv_tree_draw STATIC draw.c draw_cull.c draw_mesh.c draw_impostor.c impostor.c impostor_bake.c impostor_frame.c impostor_guess.c impostor_raster.c
            shade.c shade_outline.c shade_stand.c shade_cast.c)
target_link_libraries(sv_tree_draw PUBLIC sv_gl sv_tree sv_base m)
# Windows of sunlight on the ground, which trees are cast into.
if(TARGET sv_terrain_shadow)
  target_link_libraries(sv_tree_draw PUBLIC sv_terrain_shadow)
endif()
