/* light.c - a clear day in a dozen numbers, and the shading that every renderer shares.
 *
 * The model is tuned, not simulated: it wants pictures that look like a clear day at every hour from a
 * handful of uniforms. Sunlight is dimmed and reddened by the relative air mass of Kasten and Young (1989);
 * sky, horizon and bounce follow the sun's height between five hand-picked states from night to day. Scale:
 * at the zenith sun_rgb + sky_rgb = 1 in each channel, so a white horizontal surface under a high sun is
 * neutral and 1.
 *
 * TWIN: sv_light_surface, _leaf, _sky and _air are written again in core/gl/shaders/light.glsl; change both.
 * They use only the fields of struct sv_light. */
#include "core/scene/light.h"

/* Optical depth of one air mass by channel, and what is left of the sun at the zenith after the sky took its
 * share. */
static const float TAU[3] = {0.07f, 0.14f, 0.28f};
static const float ZENITH_SKY[3] = {0.20f, 0.24f, 0.32f};
/* The ground's own albedo as seen in the light that it throws up: grass and soil. */
static const float BOUNCE_ALBEDO[3] = {0.17f, 0.17f, 0.11f};

/* The sky by the sun's height: gradient ends and the light that it sheds on a horizontal white surface. */
struct sky_state {
    double elevation_deg;
    float zenith[3], horizon[3], shed[3];
};
static const struct sky_state STATES[] = {
    {-12, {0.006f, 0.010f, 0.024f}, {0.014f, 0.020f, 0.038f}, {0.012f, 0.017f, 0.032f}},
    {-2, {0.045f, 0.080f, 0.190f}, {0.250f, 0.200f, 0.210f}, {0.060f, 0.075f, 0.120f}},
    {4, {0.085f, 0.165f, 0.370f}, {0.640f, 0.560f, 0.500f}, {0.115f, 0.140f, 0.200f}},
    {14, {0.105f, 0.235f, 0.530f}, {0.700f, 0.740f, 0.780f}, {0.165f, 0.200f, 0.275f}},
    {50, {0.110f, 0.265f, 0.610f}, {0.690f, 0.790f, 0.890f}, {0.200f, 0.240f, 0.320f}},
};
enum { STATE_COUNT = sizeof STATES / sizeof STATES[0] };

static float mixf(float a, float b, float t)
{
    return a + (b - a) * t;
}

static double smooth(double lo, double hi, double v)
{
    double t = sv_clamp((v - lo) / (hi - lo), 0, 1);
    return t * t * (3 - 2 * t);
}

/* Relative air mass (Kasten and Young 1989, eq. 3); elevation in degrees, >= 0. 1 at the zenith, 38 at the
 * horizon. */
static double air_mass(double elevation_deg)
{
    return 1.0 / (sin(sv_radians(elevation_deg)) + 0.50572 * pow(elevation_deg + 6.07995, -1.6364));
}

static void sky_for(double elevation_deg, struct sv_light *light)
{
    int k = 0;
    while (k < STATE_COUNT - 2 && elevation_deg > STATES[k + 1].elevation_deg)
        k++;
    const struct sky_state *a = &STATES[k], *b = &STATES[k + 1];
    float t =
        (float)sv_clamp((elevation_deg - a->elevation_deg) / (b->elevation_deg - a->elevation_deg), 0, 1);
    for (int c = 0; c < 3; c++) {
        light->zenith_rgb[c] = mixf(a->zenith[c], b->zenith[c], t);
        light->horizon_rgb[c] = mixf(a->horizon[c], b->horizon[c], t);
        light->sky_rgb[c] = mixf(a->shed[c], b->shed[c], t);
    }
}

void sv_light_from_sun(const struct sv_sun *sun, struct sv_light *light)
{
    double elevation = sv_clamp(sun->elevation_rad, -SV_PI / 2, SV_PI / 2);
    double deg = sv_degrees(elevation);
    *light = (struct sv_light){.air_length_m = 30000};
    light->to_sun = sv_vec3(cos(elevation) * sin(sun->azimuth_rad), cos(elevation) * cos(sun->azimuth_rad),
                            sin(elevation));
    sky_for(deg, light);
    double mass = deg > 0 ? air_mass(deg) : 0;
    double up = deg > 0 ? smooth(0, 1.5, deg) : 0; /* the disc rises */
    for (int c = 0; c < 3; c++) {
        light->sun_rgb[c] = (float)(up * (1 - ZENITH_SKY[c]) * exp(-(double)TAU[c] * (mass - 1)));
        float level = light->sun_rgb[c] * (float)fmax(0, light->to_sun.z) + light->sky_rgb[c];
        light->ground_rgb[c] = BOUNCE_ALBEDO[c] * level;
        light->air_rgb[c] = mixf(light->horizon_rgb[c], light->zenith_rgb[c], 0.15f);
    }
}

static float dotf(struct sv_vec3 a, struct sv_vec3 b)
{
    return (float)sv_dot(a, b);
}

float sv_light_tone(float exposed)
{
    if (!(exposed > 0.5f))
        return exposed > 0 ? exposed : 0;
    float t = 2 * exposed - 1;
    return exposed < 1e6f ? 0.5f + 0.5f * (t / (1 + t)) : 1;
}

static void shade(const struct sv_light *light, float n_z, float sun, const float albedo[3], float occlusion,
                  float rgb[3])
{
    float up = 0.5f + 0.5f * n_z;
    for (int c = 0; c < 3; c++) {
        float ambient = mixf(light->ground_rgb[c], light->sky_rgb[c], up) * occlusion;
        rgb[c] = sv_light_tone(albedo[c] * (light->sun_rgb[c] * sun + ambient) * SV_LIGHT_EXPOSURE);
    }
}

void sv_light_surface(const struct sv_light *light, struct sv_vec3 n, const float albedo[3], float occlusion,
                      float visible, float rgb[3])
{
    shade(light, (float)n.z, fmaxf(0, dotf(n, light->to_sun)) * visible, albedo, occlusion, rgb);
}

void sv_light_leaf(const struct sv_light *light, struct sv_vec3 n, struct sv_vec3 to_viewer,
                   const float albedo[3], float occlusion, float translucency, float visible, float rgb[3])
{
    if (sv_dot(n, to_viewer) < 0)
        n = sv_scale(n, -1);
    float n_l = dotf(n, light->to_sun);
    shade(light, (float)n.z, (n_l >= 0 ? n_l : translucency * -n_l) * visible, albedo, occlusion, rgb);
}

/* The sky in GLSL's own terms, h = dir.z:
 *   above : base = mix(zenith, horizon, (1 - h)^5);  below: horizon * (1 - 0.45 s), s = -h / (0.15 - h)
 *   glow  : sun_rgb * (0.10 g^8 + 0.12 g^64 + 0.25 g^1024), g = max(0, dir.to_sun), faded below the horizon
 * by (1 - s) disc  : sun_rgb * 3 * (1 - smoothstep(r0^2, r1^2, |dir - to_sun|^2)), r0, r1 = 4.4, 5.0 mrad
 * (the sun's 4.65), nothing of it below the horizon */
void sv_light_sky(const struct sv_light *light, struct sv_vec3 dir, float rgb[3])
{
    float h = (float)dir.z, above = fmaxf(0, h), below = fminf(0, h);
    float a = 1 - above, a5 = a * a * a * a * a;
    float s = -below / (0.15f - below);
    float g = fmaxf(0, dotf(dir, light->to_sun));
    float g8 = g * g * g * g * g * g * g * g;
    float g64 = g8 * g8 * g8 * g8 * g8 * g8 * g8 * g8;
    float g256 = g64 * g64 * g64 * g64, g1024 = g256 * g256 * g256 * g256;
    struct sv_vec3 off = sv_sub(dir, light->to_sun);
    float disc = h >= 0 ? 1 - (float)smooth(4.4e-3 * 4.4e-3, 5.0e-3 * 5.0e-3, sv_dot(off, off)) : 0;
    float glow = (0.10f * g8 + 0.12f * g64 + 0.25f * g1024) * (1 - s) + 3 * disc;
    for (int c = 0; c < 3; c++) {
        float base = mixf(light->zenith_rgb[c], light->horizon_rgb[c], a5) * (1 - 0.45f * s);
        rgb[c] = base + light->sun_rgb[c] * glow;
    }
}

void sv_light_air(const struct sv_light *light, double distance_m, float rgb[3])
{
    if (!light->air)
        return;
    float t = 1 - expf(-(float)(distance_m / (double)light->air_length_m));
    for (int c = 0; c < 3; c++)
        rgb[c] = mixf(rgb[c], light->air_rgb[c], t);
}
