// light.glsl - shading; TWIN of core/scene/light.c (same names without sv_, same order of operations). rgb linear.
#include "frame.glsl"

const float LIGHT_EXPOSURE = 2.4; // SV_LIGHT_EXPOSURE

// Tone curve: straight up to a half, then a shoulder that never reaches 1.
vec3 light_tone(vec3 c)
{
    vec3 t = max(2.0 * c - 1.0, 0.0);
    return min(c, vec3(0.5)) + 0.5 * (t / (1.0 + t));
}

vec3 light_shade(float n_z, float sun, vec3 albedo, float occlusion)
{
    vec3 ambient = mix(ground_rgb.rgb, sky_rgb.rgb, 0.5 + 0.5 * n_z) * occlusion;
    return light_tone(albedo * (sun_rgb.rgb * sun + ambient) * LIGHT_EXPOSURE);
}

// n unit.
vec3 light_surface(vec3 n, vec3 albedo, float occlusion, float visible)
{
    return light_shade(n.z, max(0.0, dot(n, to_sun.xyz)) * visible, albedo, occlusion);
}

// n, to_viewer unit.
vec3 light_leaf(vec3 n, vec3 to_viewer, vec3 albedo, float occlusion, float translucency, float visible)
{
    n = dot(n, to_viewer) < 0.0 ? -n : n;
    float n_l = dot(n, to_sun.xyz);
    return light_shade(n.z, (n_l >= 0.0 ? n_l : translucency * -n_l) * visible, albedo, occlusion);
}

// dir unit.
vec3 light_sky(vec3 dir)
{
    float above = max(0.0, dir.z), below = min(0.0, dir.z);
    float a = 1.0 - above, a5 = a * a * a * a * a;
    float s = -below / (0.15 - below);
    float g = max(0.0, dot(dir, to_sun.xyz));
    float g2 = g * g, g4 = g2 * g2, g8 = g4 * g4;
    float g16 = g8 * g8, g32 = g16 * g16, g64 = g32 * g32;
    float g128 = g64 * g64, g256 = g128 * g128, g512 = g256 * g256, g1024 = g512 * g512;
    vec3 off = dir - to_sun.xyz;
    float disc = dir.z >= 0.0 ? 1.0 - smoothstep(4.4e-3 * 4.4e-3, 5.0e-3 * 5.0e-3, dot(off, off)) : 0.0;
    float glow = (0.10 * g8 + 0.12 * g64 + 0.25 * g1024) * (1.0 - s) + 3.0 * disc;
    vec3 base = mix(zenith_rgb.rgb, horizon_rgb.rgb, a5) * (1.0 - 0.45 * s);
    return base + sun_rgb.rgb * glow;
}

vec3 light_air(float distance_m, vec3 rgb)
{
    return air_rgb.w > 0.0 ? mix(rgb, air_rgb.rgb, 1.0 - exp(-distance_m * air_rgb.w)) : rgb;
}
