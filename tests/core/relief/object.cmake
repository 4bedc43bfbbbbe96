# Lighting of reliefs, and relief objects.
if(TARGET sv_relief_lighting)
  sv_test(test_lighting LIBS sv_relief_lighting LABELS relief)
endif()
if(TARGET sv_relief_object AND TARGET sv_relief_warp AND TARGET sv_relief_bake AND TARGET sv_relief_shadow AND TARGET sv_truth)
  find_package(embree 3 REQUIRED)
  sv_test(test_object SOURCES test_object.c ../../experiments/object_kit.c ../../experiments/object_truth.c
          LIBS sv_relief_object embree LABELS "relief;gl")
  sv_test(test_object_look SOURCES test_object_look.c ../../experiments/object_kit.c
          LIBS sv_relief_object LABELS "relief;gl")
  sv_test(test_object_casters LIBS sv_relief_object LABELS relief)
endif()
