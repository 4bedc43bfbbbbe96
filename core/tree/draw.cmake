# sv_tree_upload: meshes as GL has them; sv_tree_draw: what draws trees by OSMesa.
add_library(sv_tree_upload STATIC draw_mesh_upload.c)
target_link_libraries(sv_tree_upload PUBLIC sv_gl sv_tree sv_base)
add_library(sv_tree_draw STATIC draw.c draw_cull.c draw_mesh.c draw_impostor.c impostor.c impostor_bake.c impostor_raster.c
            shade.c shade_outline.c shade_stand.c shade_cast.c)
target_link_libraries(sv_tree_draw PUBLIC sv_tree_upload sv_gl sv_tree sv_base m)
# Windows of sunlight on the ground, which trees are cast into.
if(TARGET sv_terrain_shadow)
  target_link_libraries(sv_tree_draw PUBLIC sv_terrain_shadow)
endif()
