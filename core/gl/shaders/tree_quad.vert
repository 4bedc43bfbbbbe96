// tree_quad.vert - a far tree's quad; corners come ready from core/tree/draw_impostor.c.
#include "frame.glsl"
#ifdef SHADE
#include "tree_light.glsl"
#endif

layout(location = 0) in vec3 place; // eye-relative
layout(location = 1) in vec2 cell;
layout(location = 2) in vec4 frame_of; // the cell's corner in the atlas; layer; level
layout(location = 3) in vec4 light_of; // to the sun in the frame's axes; coverage factor
layout(location = 4) in vec4 up_of;    // world up along the frame's up and toward; texels a cell; gain of leaf_sun's guess
layout(location = 5) in vec4 leaf_of;  // translucency by colour
layout(location = 6) in vec3 right_of;
layout(location = 7) in vec3 top_of;
layout(location = 8) in vec3 sun_of; // to the sun in the model's axes
layout(location = 9) in uint id_of;
#ifdef SHADE
layout(location = 10) in vec2 light_place; // column and row coordinate (tree_light.glsl)
layout(location = 11) in vec4 first_of;    // what arrives at the tree
layout(location = 12) in vec4 second_of;
#endif

out vec2 st;
flat out vec4 frame_at;
#ifdef HARD
flat out float texels;
flat out float coverage;
flat out vec3 right;
flat out vec3 top;
flat out uint id;
#else
out float distance_m;
flat out vec4 sun_at;
flat out vec4 up_at;
flat out vec4 leaf_at;
flat out vec3 model_sun;
#endif
#ifdef SHADE
out vec2 light_at;
flat out vec4 first_light;
flat out vec4 second_light;
#endif

void main()
{
    st = cell;
    frame_at = frame_of;
#ifdef HARD
    texels = up_of.z;
    coverage = light_of.w;
    right = right_of;
    top = top_of;
    id = id_of;
#else
    distance_m = frame_distance(place);
    sun_at = light_of;
    up_at = up_of;
    leaf_at = leaf_of;
    model_sun = sun_of;
#endif
#ifdef SHADE
    light_at = light_place;
    float crown = tree_crown(frame_to_viewer(place));
    first_light = first_of * crown;
    second_light = second_of * crown;
#endif
    gl_Position = clip_from_local * vec4(place, 1.0);
}
