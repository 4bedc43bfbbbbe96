# sv_tree_draw: what draws trees by OSMesa.
add_library(sv_tree_draw STATIC draw.c draw_cull.c draw_mesh.c draw_impostor.c impostor.c impostor_bake.c impostor_raster.c
            cloud_bake.c least_squares.c billboard.c cloud_light.c cloud_order.c draw_cloud.c draw_cloud_build.c draw_cloud_form.c draw_billboard.c indirect.c indirect_save.c draw_indirect.c
            shade.c shade_outline.c shade_stand.c shade_cast.c)
target_link_libraries(sv_tree_draw PUBLIC sv_gl sv_tree sv_dxt sv_base m)
# Windows of sunlight on the ground, which trees are cast into.
if(TARGET sv_terrain_shadow)
  target_link_libraries(sv_tree_draw PUBLIC sv_terrain_shadow)
endif()
