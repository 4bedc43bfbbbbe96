# Lighting of reliefs, and relief objects.
if(TARGET sv_relief_lighting)
  sv_test(test_lighting LIBS sv_relief_lighting LABELS relief)
endif()
