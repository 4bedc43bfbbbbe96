// frame.glsl - what every shader knows of the view being drawn; std140 twin of struct frame_block in core/gl/frame.c.
// Local coordinates: world minus eye, metres, axes east, north, up.
layout(std140, binding = 0) uniform frame
{
    mat4 clip_from_local;
    vec4 camera_right, camera_up, camera_forward; // xyz: unit, world axes
    vec4 picture;    // width, height px; shift x, y px (the sample inside the pixel)
    vec4 projection; // x: 1 orthographic, 0 perspective; y: focal px, or px per metre; z: near m; w: far m
    vec4 to_sun;     // xyz: unit, world axes
    vec4 sun_rgb, sky_rgb, ground_rgb, zenith_rgb, horizon_rgb;
    vec4 air_rgb; // w: 1 / air length in m, 0 when the air is off
};

bool frame_is_orthographic()
{
    return projection.x > 0.5;
}

// Unit direction from the local point p to the viewer.
vec3 frame_to_viewer(vec3 p)
{
    return frame_is_orthographic() ? -camera_forward.xyz : normalize(-p);
}

// Distance from the viewer to the local point p, m (orthographic: along the view axis).
float frame_distance(vec3 p)
{
    return frame_is_orthographic() ? dot(camera_forward.xyz, p) : length(p);
}

// Direction (not unit; . forward = 1) of the ray through a window position; twin of sv_camera_ray. Orthographic: forward.
vec3 frame_ray(vec2 window)
{
    vec2 c = window + picture.zw - 0.5 * picture.xy;
    vec3 side = camera_right.xyz * (c.x / projection.y) - camera_up.xyz * (c.y / projection.y);
    return frame_is_orthographic() ? camera_forward.xyz : camera_forward.xyz + side;
}
