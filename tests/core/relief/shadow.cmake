# Shadows of reliefs and fields of heights: sweeps, casts, and what they cost.
if(TARGET sv_relief_shadow)
  sv_test(test_self_shadow SOURCES test_self_shadow.c shadow_fields.c LIBS sv_relief_shadow LABELS relief)
endif()
