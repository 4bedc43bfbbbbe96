// tree_cloud.vert - a tree's billboard cloud: corners of its planes, model space to local (as tree_mesh.vert).
#include "frame.glsl"
#ifdef SHADE
#include "tree_light.glsl"
#endif

layout(location = 0) in vec3 position;
layout(location = 1) in vec3 plane_centre;
layout(location = 2) in vec3 picture_at; // s, t in the plane's picture (t down), layer
layout(location = 3) in vec4 rectangle;  // s, t over the plane's rectangle, 0..1; its half sizes, model units
layout(location = 4) in vec3 plane_u;
layout(location = 5) in vec3 plane_v;
layout(location = 6) in vec4 place; // foot, eye-relative; height
layout(location = 7) in vec2 turn;  // cos, sin
layout(location = 8) in uint tree_id;
#ifdef SHADE
layout(location = 9) in vec4 first_of; // what arrives at the tree (tree_light.glsl)
layout(location = 10) in vec4 second_of;
layout(location = 2) uniform vec4 across; // struct sv_tree_light_axes
layout(location = 3) uniform vec4 along;
#endif
layout(location = 11) in vec3 leaf_shift; // core/tree/cloud_light.h
layout(location = 4) uniform float edge_on; // planes that face the viewer by less (a cosine) are left out

out vec3 st;          // picture_at
out vec4 to_viewer;   // model axes, not unit; distance, m
out vec2 rectangle_at; // plane coordinates: x, y from the plane's centre, model units
flat out vec2 half_size;
flat out vec3 model_sun;
flat out vec2 turn_of;
flat out uint id;
flat out vec3 shift;
#ifdef PLANE_AXES
flat out vec3 axis_u, axis_v; // model axes
#endif
#ifdef SHADE
out vec3 light_at; // column and row coordinate; tree_crown
flat out vec4 first_light, second_light;
#endif

vec3 turned(vec3 p)
{
    return vec3(turn.x * p.x + turn.y * p.y, turn.x * p.y - turn.y * p.x, p.z);
}

vec3 turned_back(vec3 p)
{
    return vec3(turn.x * p.x - turn.y * p.y, turn.x * p.y + turn.y * p.x, p.z);
}

void main()
{
    vec3 p = turned(position), local = place.xyz + place.w * p;
    vec3 middle = place.xyz + place.w * turned(plane_centre);
    st = picture_at;
    rectangle_at = vec2(2.0 * rectangle.x - 1.0, 1.0 - 2.0 * rectangle.y) * rectangle.zw;
    half_size = rectangle.zw;
    to_viewer = vec4(turned_back(frame_is_orthographic() ? -camera_forward.xyz : -local), frame_distance(local));
    model_sun = turned_back(to_sun.xyz);
    turn_of = turn;
    id = tree_id;
    shift = leaf_shift;
#ifdef PLANE_AXES
    axis_u = plane_u;
    axis_v = plane_v;
#endif
#ifdef SHADE
    light_at = vec3(dot(across.xyz, p) + across.w, dot(along.xyz, p) + along.w, tree_crown(frame_to_viewer(local)));
    first_light = first_of;
    second_light = second_of;
#endif
    gl_Position = clip_from_local * vec4(local, 1.0);
    if (abs(dot(turned(cross(plane_u, plane_v)), frame_to_viewer(middle))) < edge_on)
        gl_Position = vec4(2.0, 2.0, 2.0, 1.0); // all corners in one place: nothing
}
