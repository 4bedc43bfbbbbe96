# Shadows of reliefs and fields of heights: sweeps, casts, and what they cost.
if(TARGET sv_relief_shadow)
  sv_test(test_self_shadow SOURCES test_self_shadow.c shadow_fields.c LIBS sv_relief_shadow LABELS relief)
  sv_test(test_row_front SOURCES test_row_front.c shadow_fields.c LIBS sv_relief_shadow LABELS relief)
  sv_test(test_cast LIBS sv_relief_shadow LABELS relief)
  add_executable(bench_shadow bench_shadow.c shadow_fields.c)
  target_link_libraries(bench_shadow PRIVATE sv_relief_shadow m)
endif()
