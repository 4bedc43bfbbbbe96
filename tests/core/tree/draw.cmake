# Far forms that tests are not about, baked once.
add_library(sv_kept_bakes STATIC EXCLUDE_FROM_ALL kept_bakes.c)
target_link_libraries(sv_kept_bakes PUBLIC sv_tree)
# Drawing of trees: needs GL and the forest.
if(TARGET sv_tree_draw AND TARGET sv_scene)
  sv_test(test_tree_draw SOURCES test_draw.c draw_fixture.c LIBS sv_kept_bakes sv_tree_draw sv_scene sv_tree sv_gl sv_base LABELS tree TIMEOUT 600)
  sv_test(test_draw_mesh_upload SOURCES test_draw_mesh_upload.c draw_fixture.c LIBS sv_kept_bakes sv_tree_draw sv_scene sv_tree sv_gl sv_base
          LABELS tree)
  sv_test(test_tree_impostor SOURCES test_impostor.c draw_fixture.c LIBS sv_kept_bakes sv_tree_draw sv_scene sv_tree sv_gl sv_base LABELS tree
          TIMEOUT 900)
endif()
if(TARGET sv_tree_draw AND TARGET sv_scene)
  sv_test(test_sprite SOURCES test_sprite.c draw_fixture.c LIBS sv_kept_bakes sv_tree_draw sv_scene sv_tree sv_gl sv_base LABELS tree TIMEOUT 900)
endif()
if(TARGET sv_tree_draw AND TARGET sv_scene)
  sv_test(test_ladder SOURCES test_ladder.c draw_fixture.c LIBS sv_kept_bakes sv_tree_draw sv_scene sv_tree sv_gl sv_base LABELS tree TIMEOUT 600)
endif()
if(TARGET sv_tree_draw AND TARGET sv_scene)
  sv_test(test_draw_mixed SOURCES test_draw_mixed.c draw_fixture.c LIBS sv_kept_bakes sv_tree_draw sv_scene sv_tree sv_gl sv_base LABELS tree
          TIMEOUT 600)
  sv_test(test_form_change SOURCES test_form_change.c draw_fixture.c LIBS sv_kept_bakes sv_tree_draw sv_scene sv_tree sv_gl sv_base LABELS tree
          TIMEOUT 600)
endif()
# Trees in sunlight: the kernel, and all of it against rays.
if(TARGET sv_tree_draw)
  sv_test(test_shade_pass LIBS sv_tree_draw sv_base LABELS tree)
endif()
if(TARGET sv_tree_draw AND TARGET sv_truth AND TARGET sv_terrain_shadow)
  foreach(shade outline stand cast)
    sv_test(test_shade_${shade} SOURCES test_shade_${shade}.c shade_fixture.c LIBS sv_scene_kit sv_tree_draw sv_truth LABELS tree
            TIMEOUT 600)
  endforeach()
endif()
# Billboard clouds.
if(TARGET sv_tree_draw AND TARGET sv_scene)
  sv_test(test_draw_cloud SOURCES test_draw_cloud.c draw_fixture.c LIBS sv_kept_bakes sv_tree_draw sv_scene sv_tree sv_gl sv_base LABELS tree
          TIMEOUT 900)
endif()
if(TARGET sv_tree_draw)
  sv_test(test_billboard LIBS sv_tree_draw sv_tree sv_base LABELS tree TIMEOUT 600)
endif()
if(TARGET sv_tree_draw AND EXISTS ${CMAKE_SOURCE_DIR}/core/tree/import.c)
  sv_test(test_cloud SOURCES test_cloud.c cloud_fixture.c LIBS sv_tree_draw sv_tree sv_base LABELS tree TIMEOUT 600)
endif()
# Density textures.
if(TARGET sv_tree_draw AND TARGET sv_scene)
  sv_test(test_density_draw SOURCES test_density_draw.c draw_fixture.c LIBS sv_kept_bakes sv_tree_draw sv_scene sv_tree sv_gl sv_base LABELS tree
          TIMEOUT 600)
  sv_test(test_density SOURCES test_density.c draw_fixture.c LIBS sv_kept_bakes sv_tree_draw sv_scene sv_tree sv_gl sv_base LABELS tree TIMEOUT 600)
endif()
# Near trees on the CPU, against rays.
if(TARGET sv_leaf_splat AND TARGET sv_truth AND TARGET sv_scene)
  sv_test(test_leaf_splat SOURCES test_leaf_splat.c leaf_fixture.c draw_fixture.c
          LIBS sv_kept_bakes sv_scene_kit sv_leaf_splat sv_tree_draw sv_truth sv_scene sv_tree LABELS tree)
  sv_test(test_leaf_splat_extremes SOURCES test_leaf_splat_extremes.c draw_fixture.c
          LIBS sv_kept_bakes sv_leaf_splat sv_tree_draw sv_scene sv_tree LABELS tree)
  add_executable(bench_leaf_splat EXCLUDE_FROM_ALL bench_leaf_splat.c leaf_fixture.c)
  target_link_libraries(bench_leaf_splat PRIVATE sv_scene_kit sv_leaf_splat sv_tree_draw sv_truth sv_scene sv_tree
                        sv_compare)
endif()
if(TARGET sv_tree_draw AND TARGET sv_truth AND TARGET sv_terrain_shadow)
  sv_test(test_sprite_truth LIBS sv_scene_kit sv_tree_draw sv_truth sv_compare LABELS tree TIMEOUT 600)
endif()
