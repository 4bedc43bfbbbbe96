# Pre-warp: equations, two-pass warp, the plane drawn by GL, extremes of all relief modules.
if(TARGET sv_relief_prewarp)
  sv_test(test_prewarp_equations LIBS sv_relief_prewarp sv_base LABELS relief)
  sv_test(test_prewarp SOURCES test_prewarp.c named_reliefs.c ray_march.c LIBS sv_relief_prewarp sv_camera sv_base LABELS relief)
endif()
if(TARGET sv_relief_prewarp_draw AND TARGET sv_relief_warp AND TARGET sv_relief_lighting)
  sv_test(test_prewarp_draw SOURCES test_prewarp_draw.c named_reliefs.c ray_march.c LIBS sv_relief_prewarp_draw sv_relief_warp sv_relief_lighting sv_gl sv_base
          LABELS relief)
endif()
if(TARGET sv_relief_prewarp AND TARGET sv_relief_warp AND TARGET sv_relief_shadow AND TARGET sv_relief_lighting)
  sv_test(test_relief_extremes SOURCES test_relief_extremes.c extremes_kit.c LIBS sv_relief_prewarp sv_relief_warp sv_relief_shadow sv_relief_lighting sv_base LABELS relief)
endif()
