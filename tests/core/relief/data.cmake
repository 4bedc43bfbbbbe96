# Relief textures as data, what makes them, and the truth that warps are judged by.
if(TARGET sv_relief_data)
  sv_test(test_relief LIBS sv_relief_data LABELS relief)
  sv_test(test_relief_build SOURCES test_build.c LIBS sv_relief_data LABELS relief)
  sv_test(test_ray_march SOURCES test_ray_march.c ray_march.c named_reliefs.c LIBS sv_relief_data sv_camera LABELS relief)
endif()
if(TARGET sv_relief_bake)
  sv_test(test_relief_bake SOURCES test_bake.c LIBS sv_relief_bake sv_relief_data sv_gl sv_tree sv_base LABELS relief)
endif()
if(TARGET sv_relief_warp AND TARGET sv_relief_prewarp)
  sv_test(test_warp_agree SOURCES test_warp_agree.c warp_pictures.c ray_march.c named_reliefs.c LIBS sv_relief_warp
          sv_relief_prewarp sv_camera sv_base LABELS relief)
endif()
