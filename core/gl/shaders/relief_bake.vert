// relief_bake.vert - a mesh seen against a relief's f (core/relief/bake.c): model space to a tile of the relief.
layout(location = 0) in vec3 position;
layout(location = 1) in vec3 model_normal;
layout(location = 2) in float model_occlusion;
layout(location = 3) in vec2 uv;

layout(location = 0) uniform mat4 clip_from_model;
layout(location = 1) uniform mat3 relief_from_model; // turns directions into (a^, b^, f)

out vec3 normal;
out vec3 uv_occlusion;

void main()
{
    normal = relief_from_model * model_normal;
    uv_occlusion = vec3(uv, model_occlusion);
    gl_Position = clip_from_model * vec4(position, 1.0);
}
