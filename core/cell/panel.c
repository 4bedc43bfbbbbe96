/* panel.c - memory of a panel: sizes, header, checks. What fills the crowns is panel_crowns.c. */
#include "core/cell/panel.h"

#include <math.h>
#include <string.h>

#define MAGIC UINT64_C(0x314c4e5056530a1a) /* "\x1a\nSVPNL1" */
#define VERSION UINT32_C(1)

struct header {
    uint64_t magic;
    uint32_t version, header_bytes;
    uint64_t bytes; /* of the block */
    struct sv_panel_about about;
};

/* Where the arrays of a block begin; those of a layer that is not there take no room. */
struct layout {
    size_t color, q, tiles, ground_color, ground_q, end;
};

static size_t reserve(size_t *end, size_t bytes)
{
    size_t at = *end;
    if (bytes > 0)
        *end = (at + bytes + 2 * SV_PANEL_ALIGN - 1) / SV_PANEL_ALIGN * SV_PANEL_ALIGN;
    return at;
}

static bool layout_of(int size, unsigned layers, struct layout *layout)
{
    if (size < SV_PANEL_SIZE_MIN || size > SV_PANEL_SIZE_MAX || layers == 0 ||
        (layers & ~(unsigned)(SV_PANEL_CROWNS | SV_PANEL_GROUND)) != 0)
        return false;
    size_t crowns = layers & SV_PANEL_CROWNS ? 1 : 0, ground = layers & SV_PANEL_GROUND ? 1 : 0;
    size_t texels = (size_t)size * (size_t)size, side = (size_t)sv_panel_tiles(size);
    layout->end = 0;
    reserve(&layout->end, sizeof(struct header));
    layout->color = reserve(&layout->end, crowns * texels * 4);
    layout->q = reserve(&layout->end, crowns * texels * sizeof(uint16_t));
    layout->tiles = reserve(&layout->end, crowns * side * side * sizeof(struct sv_panel_tile));
    layout->ground_color = reserve(&layout->end, ground * texels * 4);
    layout->ground_q = reserve(&layout->end, ground * texels * sizeof(float));
    return true;
}

size_t sv_panel_bytes(int size, unsigned layers)
{
    struct layout layout;
    return layout_of(size, layers, &layout) ? layout.end : 0;
}

static const char *fault_of(const struct sv_panel_about *about)
{
    if ((unsigned)about->face >= SV_CELL_FACES)
        return "face";
    if (!(about->distance_m > 0 && isfinite(about->distance_m)))
        return "distance_m";
    if (!(isfinite(about->place.v.x) && isfinite(about->place.v.y) && isfinite(about->place.v.z)))
        return "place";
    return sv_panel_bytes(about->size, about->layers) ? NULL : "size";
}

static void clear_after(uint8_t *block, size_t from, size_t bytes, size_t to)
{
    memset(block + from + bytes, 0, to - from - bytes);
}

static void room_of(uint8_t *block, const struct layout *at, const struct sv_panel_about *about,
                    struct sv_panel_room *room)
{
    bool crowns = about->layers & SV_PANEL_CROWNS, ground = about->layers & SV_PANEL_GROUND;
    *room = (struct sv_panel_room){.size = about->size};
    if (crowns) {
        room->color = (void *)(block + at->color);
        room->q = (void *)(block + at->q);
        room->tiles = (void *)(block + at->tiles);
    }
    if (ground) {
        room->ground_color = (void *)(block + at->ground_color);
        room->ground_q = (void *)(block + at->ground_q);
    }
}

enum sv_status sv_panel_init(void *block, size_t bytes, const struct sv_panel_about *about,
                             struct sv_panel_room *room, struct sv_error *error)
{
    const char *fault = fault_of(about);
    if (fault)
        return sv_fail(error, SV_EINVAL, fault, "is out of range for a panel");
    struct layout at;
    layout_of(about->size, about->layers, &at);
    if (bytes < at.end || (uintptr_t)block % SV_PANEL_ALIGN != 0)
        return sv_fail(error, SV_EINVAL, "block", "of %zu bytes is too small or not aligned: %zu are needed",
                       bytes, at.end);
    struct header header;
    memset(&header, 0, sizeof header); /* also what lies between its members */
    header.magic = MAGIC;
    header.version = VERSION;
    header.header_bytes = sizeof header;
    header.bytes = at.end;
    header.about = *about;
    uint8_t *base = block;
    size_t texels = (size_t)about->size * (size_t)about->size, side = (size_t)sv_panel_tiles(about->size);
    memcpy(base, &header, sizeof header);
    clear_after(base, 0, sizeof header, at.color);
    if (about->layers & SV_PANEL_CROWNS) {
        clear_after(base, at.color, texels * 4, at.q);
        clear_after(base, at.q, texels * sizeof(uint16_t), at.tiles);
        clear_after(base, at.tiles, side * side * sizeof(struct sv_panel_tile), at.ground_color);
    }
    if (about->layers & SV_PANEL_GROUND) {
        clear_after(base, at.ground_color, texels * 4, at.ground_q);
        clear_after(base, at.ground_q, texels * sizeof(float), at.end);
    }
    room_of(base, &at, about, room);
    return SV_OK;
}

enum sv_status sv_panel_open(const void *block, size_t bytes, struct sv_panel *panel, struct sv_error *error)
{
    struct header header;
    if (bytes < sizeof header || (uintptr_t)block % SV_PANEL_ALIGN != 0)
        return sv_fail(error, SV_EFORMAT, "block", "of %zu bytes cannot be a panel", bytes);
    memcpy(&header, block, sizeof header);
    if (header.magic != MAGIC || header.version != VERSION || header.header_bytes != sizeof header)
        return sv_fail(error, SV_EFORMAT, "block", "is not a panel of version %u", VERSION);
    const char *fault = fault_of(&header.about);
    if (fault)
        return sv_fail(error, SV_EFORMAT, fault, "of a panel is out of range");
    struct layout at;
    layout_of(header.about.size, header.about.layers, &at);
    if (header.bytes != at.end || bytes < at.end)
        return sv_fail(error, SV_EFORMAT, "block", "of %zu bytes, a panel of %zu", bytes, at.end);
    const uint8_t *base = block;
    *panel = (struct sv_panel){.about = header.about};
    if (header.about.layers & SV_PANEL_CROWNS)
        panel->crowns = (struct sv_panel_layer){header.about.size, (const void *)(base + at.color),
                                                (const void *)(base + at.q), (const void *)(base + at.tiles)};
    if (header.about.layers & SV_PANEL_GROUND)
        panel->ground = (struct sv_panel_ground){header.about.size, (const void *)(base + at.ground_color),
                                                 (const void *)(base + at.ground_q)};
    return SV_OK;
}
