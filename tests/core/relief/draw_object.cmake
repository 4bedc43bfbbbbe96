# Objects in a picture. sv_scene_kit comes from tests/core/view.
if(TARGET sv_view)
  add_library(sv_object_fixture STATIC object_fixture.c)
  target_link_libraries(sv_object_fixture PUBLIC sv_scene_kit)
  add_executable(preview_object preview_object.c)
  target_link_libraries(preview_object PRIVATE sv_object_fixture)
  set_target_properties(sv_object_fixture preview_object PROPERTIES EXCLUDE_FROM_ALL ON)
endif()
