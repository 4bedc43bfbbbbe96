# sv_tree_upload: meshes as GL has them; sv_tree_draw: what draws trees by OSMesa.
add_library(sv_tree_upload STATIC draw_mesh_upload.c)
target_link_libraries(sv_tree_upload PUBLIC sv_gl sv_tree sv_base)
add_library(sv_tree_draw STATIC draw.c draw_cull.c draw_mesh.c draw_impostor.c impostor.c impostor_bake.c impostor_raster.c
            cloud_bake.c least_squares.c billboard.c cloud_light.c draw_cloud.c draw_cloud_form.c draw_billboard.c
            density.c density_sample.c density_paper.c density_plain.c density_save.c density_look.c density_twin.c density_tune.c draw_density.c
            indirect.c indirect_save.c draw_indirect.c
            shade.c shade_outline.c shade_stand.c shade_cast.c)
target_link_libraries(sv_tree_draw PUBLIC sv_tree_upload sv_gl sv_tree sv_dxt sv_base m)
# Windows of sunlight on the ground, which trees are cast into.
if(TARGET sv_terrain_shadow)
  target_link_libraries(sv_tree_draw PUBLIC sv_terrain_shadow)
endif()
