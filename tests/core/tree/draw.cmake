# Drawing of trees: needs GL and the forest.
if(TARGET sv_tree_draw AND TARGET sv_scene)
  sv_test(test_tree_draw SOURCES test_draw.c draw_fixture.c LIBS sv_tree_draw sv_scene sv_tree sv_gl sv_base LABELS tree TIMEOUT 600)
  sv_test(test_draw_mesh_upload SOURCES test_draw_mesh_upload.c draw_fixture.c LIBS sv_tree_draw sv_scene sv_tree sv_gl sv_base
          LABELS tree)
  sv_test(test_tree_impostor SOURCES test_impostor.c draw_fixture.c LIBS sv_tree_draw sv_scene sv_tree sv_gl sv_base LABELS tree
          TIMEOUT 900)
endif()
# Trees in sunlight, against rays.
if(TARGET sv_tree_draw AND TARGET sv_truth AND TARGET sv_terrain_shadow)
  foreach(shade outline stand cast)
    sv_test(test_shade_${shade} SOURCES test_shade_${shade}.c shade_fixture.c LIBS sv_scene_kit sv_tree_draw sv_truth LABELS tree
            TIMEOUT 600)
  endforeach()
endif()
