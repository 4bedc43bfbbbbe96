/* sun.c - where the sun stands. Does not add refraction and knows no time zones.
 *
 * Method: Meeus, Astronomical Algorithms (2nd ed. 1998), chapter 25 "Solar coordinates", low accuracy (0.01
 * deg in longitude), sidereal time by eq. 12.4, horizontal coordinates by eqs. 13.5 and 13.6; the same that
 * NOAA's solar calculator uses. Terrestrial time is taken as universal time plus 65 s: the sun moves 0.0007
 * deg in that time, and delta T stays within
 * +-70 s of it for 1900 .. 2050.
 *
 * T centuries since J2000.0, L0 mean longitude, M mean anomaly, C equation of the centre, Omega lunar node
 * (nutation), lambda apparent longitude, eps obliquity, alpha, delta right ascension and declination, H hour
 * angle, theta sidereal time. */
#include "core/geo/geo.h"

#include <math.h>

#include "core/base/vec.h"

static double turn(double deg)
{
    double r = fmod(deg, 360.0);
    return r < 0 ? r + 360.0 : r;
}

void sv_sun_position(double unix_s, double lon_deg, double lat_deg, double *azimuth_rad,
                     double *elevation_rad)
{
    if (!isfinite(unix_s) || !isfinite(lon_deg) || !isfinite(lat_deg)) {
        *azimuth_rad = *elevation_rad = NAN;
        return;
    }
    const double delta_t_s = 65.0;
    const double days = (unix_s - 946728000.0) / 86400.0; /* since J2000.0 = 2000-01-01T12:00Z */
    const double T = (days + delta_t_s / 86400.0) / 36525.0;
    const double L0 = 280.46646 + T * (36000.76983 + T * 0.0003032);                  /* eq. 25.2 */
    const double M = sv_radians(turn(357.52911 + T * (35999.05029 - T * 0.0001537))); /* eq. 25.3 */
    const double C = (1.914602 - T * (0.004817 + T * 0.000014)) * sin(M) +
                     (0.019993 - 0.000101 * T) * sin(2 * M) + 0.000289 * sin(3 * M);
    const double Omega = sv_radians(turn(125.04 - 1934.136 * T));
    const double lambda = sv_radians(turn(L0 + C - 0.00569 - 0.00478 * sin(Omega)));
    const double eps0 = 23.43929111 - T * (0.0130041667 + T * (1.639e-7 - T * 5.036e-7)); /* eq. 22.2 */
    const double eps = sv_radians(eps0 + 0.00256 * cos(Omega));                           /* eq. 25.8 */
    const double alpha = atan2(cos(eps) * sin(lambda), cos(lambda));                      /* eq. 25.6 */
    const double delta = asin(sin(eps) * sin(lambda));                                    /* eq. 25.7 */

    const double Tu = days / 36525.0;
    const double theta0 = turn(280.46061837 + 360.98564736629 * days) +
                          Tu * Tu * (0.000387933 - Tu / 38710000.0); /* eq. 12.4 */
    const double nutation = -0.00478 * sin(Omega) * cos(eps);        /* equation of the equinoxes, deg */
    const double H = sv_radians(turn(theta0 + nutation + lon_deg)) - alpha;
    const double phi = sv_radians(lat_deg);
    /* eq. 13.5 counts azimuth from the south; turned by 180 deg here */
    const double azimuth =
        atan2(-cos(delta) * sin(H), cos(phi) * sin(delta) - sin(phi) * cos(delta) * cos(H));
    const double sine = sin(phi) * sin(delta) + cos(phi) * cos(delta) * cos(H); /* eq. 13.6 */
    const double elevation = asin(sv_clamp(sine, -1, 1));
    const double parallax = sv_radians(8.794 / 3600.0); /* seen from the surface, ch. 40 */
    *azimuth_rad = azimuth < 0 ? azimuth + 2 * SV_PI : azimuth;
    *elevation_rad = elevation - parallax * cos(elevation);
}
