/* compose.h - gathered light over what is behind it, to bytes. */
#ifndef SV_VIEW_COMPOSE_H
#define SV_VIEW_COMPOSE_H

#include <stddef.h>
#include <stdint.h>

/* out[k] = sRGB code of light[k].rgb + light[k].pass * behind[k].rgb (decoded); alpha alike: 1 - pass + pass
 * * behind's. light: linear {r, g, b, what still passes}; behind: sRGB, premultiplied. Where less than 1/255
 * passes, light is spread over it. out may be behind. After sv_color_init. */
void sv_compose(size_t count, const float (*light)[4], const uint8_t (*behind)[4], uint8_t (*out)[4]);

#endif
