/* panel.c - memory of a panel: rooms, blocks, header, checks. What fills the crowns is panel_crowns.c. */
#include "core/cell/panel.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define MAGIC UINT64_C(0x314c4e5056530a1a) /* "\x1a\nSVPNL1" */
#define VERSION UINT32_C(2)

struct header {
    uint64_t magic;
    uint32_t version, header_bytes;
    uint64_t bytes; /* of the block */
    struct sv_panel_about about;
    uint32_t last_slot;                /* of crowns; 0 without */
    int32_t ground_first, ground_rows; /* 0 without */
    uint32_t reserved;                 /* 0 */
};

/* Where the arrays of a block begin; those of a layer that is not there take no room. */
struct layout {
    size_t tiles, q, color, ground_color, ground_q, end;
};

static size_t reserve(size_t *end, size_t bytes)
{
    size_t at = *end;
    if (bytes > 0)
        *end = (at + bytes + 2 * SV_PANEL_ALIGN - 1) / SV_PANEL_ALIGN * SV_PANEL_ALIGN;
    return at;
}

static bool is_legal(int size, unsigned layers)
{
    return size >= SV_PANEL_SIZE_MIN && size <= SV_PANEL_SIZE_MAX && layers != 0 &&
           (layers & ~(unsigned)(SV_PANEL_CROWNS | SV_PANEL_GROUND)) == 0;
}

static struct layout layout_of(const struct header *header)
{
    const struct sv_panel_about *about = &header->about;
    size_t side = (size_t)sv_panel_tiles(about->size), slots = (size_t)header->last_slot + 1;
    size_t crowns = about->layers & SV_PANEL_CROWNS ? 1 : 0;
    size_t texels = about->layers & SV_PANEL_GROUND ? (size_t)header->ground_rows * (size_t)about->size : 0;
    struct layout at = {.end = 0};
    reserve(&at.end, sizeof *header);
    at.tiles = reserve(&at.end, crowns * side * side * sizeof(struct sv_panel_tile));
    at.q = reserve(&at.end, crowns * slots * SV_PANEL_SLOT_CODES * sizeof(uint16_t));
    at.color = reserve(&at.end, crowns * slots * SV_PANEL_SLOT_COLORS * 4);
    at.ground_color = reserve(&at.end, texels * 4);
    at.ground_q = reserve(&at.end, texels * sizeof(float));
    return at;
}

static const char *fault_of(const struct sv_panel_about *about)
{
    if ((unsigned)about->face >= SV_CELL_FACES)
        return "face";
    if (!(about->distance_m > 0 && isfinite(about->distance_m)))
        return "distance_m";
    if (!(isfinite(about->place.v.x) && isfinite(about->place.v.y) && isfinite(about->place.v.z)))
        return "place";
    return is_legal(about->size, about->layers) ? NULL : "size";
}

/* ---- rooms ---- */

enum sv_status sv_panel_room_create(int size, unsigned layers, struct sv_panel_room *room,
                                    struct sv_error *error)
{
    if (!is_legal(size, layers))
        return sv_fail(error, SV_EINVAL, "size", "%d texels a side, layers %u are out of range for a panel",
                       size, layers);
    size_t texels = (size_t)size * (size_t)size, side = (size_t)sv_panel_tiles(size);
    bool crowns = layers & SV_PANEL_CROWNS, ground = layers & SV_PANEL_GROUND;
    struct sv_panel_room r = {.size = size};
    if (crowns) {
        r.color = malloc(texels * sizeof *r.color);
        r.q = malloc(texels * sizeof *r.q);
        r.tiles = malloc(side * side * sizeof *r.tiles);
    }
    if (ground) {
        r.ground_color = malloc(texels * sizeof *r.ground_color);
        r.ground_q = malloc(texels * sizeof *r.ground_q);
    }
    if ((crowns && (!r.color || !r.q || !r.tiles)) || (ground && (!r.ground_color || !r.ground_q))) {
        sv_panel_room_finish(&r);
        return sv_fail(error, SV_ENOMEM, "relief", "no memory to draw a panel of %zu texels", texels);
    }
    *room = r;
    return SV_OK;
}

void sv_panel_room_finish(struct sv_panel_room *room)
{
    free(room->color);
    free(room->q);
    free(room->tiles);
    free(room->ground_color);
    free(room->ground_q);
    *room = (struct sv_panel_room){0};
}

/* Lanes of 16 columns, so that compilers make vectors of them. Code 0 less 1 is the largest number: never the
 * least. */
static inline void set_tile(const uint16_t *q, int size, const int columns, int rows,
                            struct sv_panel_tile *tile)
{
    uint16_t low[SV_PANEL_TILE], high[SV_PANEL_TILE] = {0}, count[SV_PANEL_TILE] = {0};
    memset(low, 255, sizeof low);
    for (int j = 0; j < rows; j++, q += size)
        for (int i = 0; i < columns; i++) {
            uint16_t code = q[i], less = (uint16_t)(code - 1);
            low[i] = less < low[i] ? less : low[i];
            high[i] = code > high[i] ? code : high[i];
            count[i] = (uint16_t)(count[i] + (code != 0));
        }
    *tile = (struct sv_panel_tile){65535, 0, 0, 0};
    for (int i = 0; i < columns; i++) {
        tile->q_min = low[i] < tile->q_min ? low[i] : tile->q_min;
        tile->q_max = high[i] > tile->q_max ? high[i] : tile->q_max;
        tile->count = (uint16_t)(tile->count + count[i]);
    }
    tile->q_min++; /* of none: 0 */
}

/* Columns, or rows, of a tile that begins at texel `first`. */
static int extent(const struct sv_panel_room *room, int first)
{
    return room->size - first < SV_PANEL_TILE ? room->size - first : SV_PANEL_TILE;
}

static void set_tiles(const struct sv_panel_room *room)
{
    int side = sv_panel_tiles(room->size), size = room->size;
    for (int j = 0; j < side; j++)
        for (int i = 0; i < side; i++) {
            int x = i * SV_PANEL_TILE, y = j * SV_PANEL_TILE, rows = extent(room, y);
            const uint16_t *q = room->q + (size_t)y * (size_t)size + (size_t)x;
            struct sv_panel_tile *tile = &room->tiles[j * side + i];
            if (size - x >= SV_PANEL_TILE)
                set_tile(q, size, SV_PANEL_TILE, rows, tile);
            else
                set_tile(q, size, size - x, rows, tile);
        }
}

/* Whether any texel right of the tile or below it, that is blended with the tile's own, shows something. */
static bool shows_beside(const struct sv_panel_room *room, int tx, int ty)
{
    int side = sv_panel_tiles(room->size), size = room->size, x = tx * SV_PANEL_TILE, y = ty * SV_PANEL_TILE;
    const struct sv_panel_tile *tile = &room->tiles[ty * side + tx];
    const uint16_t *q = room->q + (size_t)y * (size_t)size + (size_t)x;
    bool right = tx + 1 < side, below = ty + 1 < side, any = false;
    if (right && tile[1].count > 0)
        for (int j = 0; j < extent(room, y); j++)
            any |= q[j * size + SV_PANEL_TILE] != 0;
    if (below && tile[side].count > 0)
        for (int i = 0; i < extent(room, x); i++)
            any |= q[SV_PANEL_TILE * size + i] != 0;
    return any || (right && below && q[SV_PANEL_TILE * size + SV_PANEL_TILE] != 0);
}

/* What shows nothing has a slot that is beyond the last, or it. */
static void set_slots(struct sv_panel_room *room)
{
    int side = sv_panel_tiles(room->size);
    room->last_slot = 0;
    for (int t = 0; t < side * side; t++) {
        bool stored = room->tiles[t].count > 0 || shows_beside(room, t % side, t / side);
        room->tiles[t].slot = (uint16_t)(stored ? room->last_slot++ : UINT16_MAX);
    }
}

static bool row_shows(const struct sv_panel_room *room, int j)
{
    const float *q = room->ground_q + (size_t)j * (size_t)room->size;
    bool any = false;
    for (int i = 0; i < room->size; i++)
        any |= !(q[i] == 0);
    return any;
}

static void set_rows(struct sv_panel_room *room)
{
    int first = 0, end = room->size;
    while (first < end && !row_shows(room, first))
        first++;
    while (end > first && !row_shows(room, end - 1))
        end--;
    room->ground_first = first < end ? first : 0;
    room->ground_rows = end - first;
}

/* ---- blocks ---- */

static struct header header_of(const struct sv_panel_room *room, const struct sv_panel_about *about)
{
    struct header header;
    memset(&header, 0, sizeof header); /* also what lies between its members, and those of about */
    header.magic = MAGIC;
    header.version = VERSION;
    header.header_bytes = sizeof header;
    header.about.key = about->key;
    header.about.place = about->place;
    header.about.distance_m = about->distance_m;
    header.about.face = about->face;
    header.about.size = about->size;
    header.about.layers = about->layers;
    header.last_slot = room->color ? room->last_slot : 0;
    header.ground_first = room->ground_q ? room->ground_first : 0;
    header.ground_rows = room->ground_q ? room->ground_rows : 0;
    header.bytes = layout_of(&header).end;
    return header;
}

static unsigned layers_of(const struct sv_panel_room *room)
{
    return (room->color ? SV_PANEL_CROWNS : 0u) | (room->ground_q ? SV_PANEL_GROUND : 0u);
}

size_t sv_panel_measure(struct sv_panel_room *room)
{
    if (room->color) {
        set_tiles(room);
        set_slots(room);
    }
    if (room->ground_q)
        set_rows(room);
    const struct sv_panel_about about = {.size = room->size, .layers = layers_of(room)};
    return header_of(room, &about).bytes;
}

/* Copies an array to its place, and zeros to where the next one begins. */
static void put(uint8_t *block, size_t at, const void *from, size_t bytes, size_t next)
{
    memcpy(block + at, from, bytes);
    memset(block + at + bytes, 0, next - at - bytes);
}

static void put_slot(const struct sv_panel_room *room, int tx, int ty, uint16_t *q, uint8_t (*color)[4])
{
    int x = tx * SV_PANEL_TILE, y = ty * SV_PANEL_TILE, columns = extent(room, x), rows = extent(room, y);
    int wide = columns + (x + columns < room->size), high = rows + (y + rows < room->size);
    size_t first = (size_t)y * (size_t)room->size + (size_t)x;
    memset(q, 0, SV_PANEL_SLOT_CODES * sizeof *q);
    memset(color, 0, SV_PANEL_SLOT_COLORS * sizeof *color);
    for (int j = 0; j < rows; j++)
        memcpy(q + j * SV_PANEL_TILE, room->q + first + (size_t)j * (size_t)room->size,
               (size_t)columns * sizeof *q);
    for (int j = 0; j < high; j++)
        memcpy(color + j * SV_PANEL_SLOT_SIDE, room->color + first + (size_t)j * (size_t)room->size,
               (size_t)wide * sizeof *color);
}

static void put_crowns(const struct sv_panel_room *room, const struct layout *at, uint8_t *block)
{
    int side = sv_panel_tiles(room->size);
    uint16_t *q = (void *)(block + at->q);
    uint8_t(*color)[4] = (void *)(block + at->color);
    size_t last = room->last_slot;
    put(block, at->tiles, room->tiles, (size_t)side * (size_t)side * sizeof *room->tiles, at->q);
    for (int t = 0; t < side * side; t++) {
        size_t slot = room->tiles[t].slot;
        if (slot < last)
            put_slot(room, t % side, t / side, q + slot * SV_PANEL_SLOT_CODES,
                     color + slot * SV_PANEL_SLOT_COLORS);
    }
    q += last * SV_PANEL_SLOT_CODES;
    color += last * SV_PANEL_SLOT_COLORS;
    memset(q, 0, (size_t)(block + at->color - (uint8_t *)q));
    memset(color, 0, (size_t)(block + at->ground_color - (uint8_t *)color));
}

enum sv_status sv_panel_write(const struct sv_panel_room *room, const struct sv_panel_about *about,
                              void *block, size_t bytes, struct sv_error *error)
{
    const char *fault = fault_of(about);
    if (!fault && (about->size != room->size || about->layers != layers_of(room)))
        fault = "size";
    if (fault)
        return sv_fail(error, SV_EINVAL, fault, "is out of range for a panel, or not that of its room");
    struct header header = header_of(room, about);
    struct layout at = layout_of(&header);
    if (bytes < at.end || (uintptr_t)block % SV_PANEL_ALIGN != 0)
        return sv_fail(error, SV_EINVAL, "block", "of %zu bytes is too small or not aligned: %zu are needed",
                       bytes, at.end);
    put(block, 0, &header, sizeof header, at.tiles);
    if (room->color)
        put_crowns(room, &at, block);
    if (room->ground_q && room->ground_rows > 0) {
        size_t first = (size_t)room->ground_first * (size_t)room->size,
               texels = (size_t)room->ground_rows * (size_t)room->size;
        put(block, at.ground_color, room->ground_color + first, texels * 4, at.ground_q);
        put(block, at.ground_q, room->ground_q + first, texels * sizeof *room->ground_q, at.end);
    }
    return SV_OK;
}

/* Whether a header's numbers of what is stored are possible. */
static bool is_possible(const struct header *header)
{
    uint32_t side = (uint32_t)sv_panel_tiles(header->about.size);
    int32_t size = header->about.size, first = header->ground_first, rows = header->ground_rows;
    return header->last_slot <= side * side && first >= 0 && first <= size && rows >= 0 &&
           rows <= size - first;
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
    if (!is_possible(&header))
        return sv_fail(error, SV_EFORMAT, "block", "says that more of a panel is stored than there is");
    struct layout at = layout_of(&header);
    if (header.bytes != at.end || bytes < at.end)
        return sv_fail(error, SV_EFORMAT, "block", "of %zu bytes, a panel of %zu", bytes, at.end);
    const uint8_t *base = block;
    *panel = (struct sv_panel){.about = header.about};
    if (header.about.layers & SV_PANEL_CROWNS)
        panel->crowns =
            (struct sv_panel_layer){header.about.size, header.last_slot, (const void *)(base + at.color),
                                    (const void *)(base + at.q), (const void *)(base + at.tiles)};
    if (header.about.layers & SV_PANEL_GROUND)
        panel->ground = (struct sv_panel_ground){header.about.size, header.ground_first, header.ground_rows,
                                                 (const void *)(base + at.ground_color),
                                                 (const void *)(base + at.ground_q)};
    return SV_OK;
}
