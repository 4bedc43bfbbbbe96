# sv_tree_upload: meshes as GL has them.
add_library(sv_tree_upload STATIC draw_mesh_upload.c)
target_link_libraries(sv_tree_upload PUBLIC sv_gl sv_tree sv_base)
# sv_tree_draw: what draws trees: by OSMesa, and on the CPU (sprite.h, leaf_splat.h).
add_library(
  sv_tree_draw STATIC
  draw.c draw_cull.c draw_mesh.c ladder.c
  impostor.c impostor_frame.c impostor_guess.c impostor_raster.c least_squares.c
  cloud_bake.c cloud_light.c cloud_order.c billboard.c draw_billboard.c
  draw_cloud.c draw_cloud_build.c draw_cloud_form.c
  indirect.c indirect_save.c draw_indirect.c
  density.c density_sample.c density_paper.c density_plain.c density_save.c density_look.c density_twin.c density_tune.c
  draw_density.c
  shade.c shade_outline.c shade_stand.c shade_again.c shade_pass.c shade_pass_avx2.c shade_cast.c
  draw_mixed.c sprite.c sprite_band.c sprite_atlas.c sprite_bake.c sprite_setup.c sprite_kernel.c sprite_kernel_avx2.c sprite_resolve.c
  sprite_resolve_avx2.c)
set_source_files_properties(shade_pass_avx2.c sprite_kernel_avx2.c sprite_resolve_avx2.c PROPERTIES COMPILE_OPTIONS "${SV_AVX2_OPTIONS}")
target_link_libraries(sv_tree_draw PUBLIC sv_leaf_splat sv_tree_upload sv_gl sv_tree sv_dxt sv_base m)
# Windows of sunlight on the ground, which trees are cast into.
if(TARGET sv_terrain_shadow)
  target_link_libraries(sv_tree_draw PUBLIC sv_terrain_shadow)
endif()
# sv_leaf_splat: near trees on the CPU.
set_source_files_properties(leaf_project_avx2.c leaf_raster_avx2.c leaf_shade_avx2.c PROPERTIES COMPILE_OPTIONS "${SV_AVX2_OPTIONS}")
add_library(sv_leaf_splat STATIC leaf_form.c leaf_map.c leaf_splat.c leaf_tree.c leaf_raster.c
            leaf_project_avx2.c leaf_raster_avx2.c leaf_shade.c leaf_shade_avx2.c)
target_link_libraries(sv_leaf_splat PUBLIC sv_tree sv_base sv_camera m)
