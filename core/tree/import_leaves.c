/* import_leaves.c - which triangles of an imported model are leaves.
 *
 * Alpha tells first: a material is leaves when a real share of what its triangles show of its texture is cut
 * away (sampled on the triangles, so that an atlas is judged by the part in use) or when glTF says MASK or
 * BLEND and something is. Names (material, texture, then mesh) tell where alpha says nothing, and keep bark
 * with alpha what it is. A material that is leaves by alpha but not by name may be an atlas for the whole
 * tree: its connected parts that show nothing cut away, and are no cards, become wood. */
#include "core/tree/import_parts.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Shares of area. Bark photographs with stray alpha stay under 1 %; the densest leaf cards in the collection
 * cut away 40 %. */
#define CUT_SHARE_TEXTURE 0.03
#define CUT_SHARE_DECLARED 0.002 /* the author says MASK: believe little */
#define CUT_SHARE_WOOD 0.01      /* a part below it is wood, when it is no card */
#define SHEET_SHARE \
    0.4 /* of the edges have one triangle only: quads 0.8, strips 0.5; tubes with a seam 0.1 */
#define KEPT_SHARE_MIN 0.02 /* a cutoff that leaves less than this is too high */
enum { CARD_TRIANGLES = 8, SAMPLES_PART = 128, SAMPLES_TRIANGLE_MIN = 4, SAMPLES_TRIANGLE_MAX = 64 };

/* A connected part of one material, kept at the root of its vertices. */
struct part {
    uint32_t triangles;
    double area, cut, kept;
    float alpha_max;
};

static bool has_word(const char *text, const char *const *words)
{
    for (; *words; words++)
        if (strstr(text, *words))
            return true;
    return false;
}

int raw_name_hint(const struct raw_material *m)
{
    static const char *const leaf[] = {"leaf",    "leav",   "foliage", "frond", "needle", "petal",
                                       "blossom", "flower", "blatt",   "laub",  "feuill", "hoja",
                                       "folha",   "foglia", "grass",   "fern",  "canopy", NULL};
    static const char *const wood[] = {"bark",  "trunk", "stem", "wood",  "root",    "soil",  "stamm",
                                       "rinde", "tronc", "holz", "stump", "corteza", "casca", NULL};
    const char *const texts[] = {m->hint, m->mesh_hint};
    for (int i = 0; i < 2; i++) {
        bool is_leaf = has_word(texts[i], leaf), is_wood = has_word(texts[i], wood);
        if (is_leaf != is_wood)
            return is_leaf ? 1 : -1;
    }
    return 0;
}

/* Words that mean leaf cards or bare wood alike: geometry decides. */
static bool may_be_cards(const struct raw_material *m)
{
    static const char *const words[] = {"branch", "twig", "card", "billboard", "ast_", "zweig", NULL};
    return has_word(m->hint, words);
}

static uint32_t find_root(uint32_t *parent, uint32_t i)
{
    while (parent[i] != i) {
        parent[i] = parent[parent[i]];
        i = parent[i];
    }
    return i;
}

static void unite(uint32_t *parent, uint32_t a, uint32_t b)
{
    a = find_root(parent, a), b = find_root(parent, b);
    if (a < b)
        parent[b] = a;
    else
        parent[a] = b;
}

static double triangle_area(const struct raw_model *raw, const struct raw_triangle *t)
{
    const double *p = raw->vertices[t->v[0]].p, *q = raw->vertices[t->v[1]].p, *r = raw->vertices[t->v[2]].p;
    double c2 = 0;
    for (int i = 0; i < 3; i++) {
        int j = (i + 1) % 3, k = (i + 2) % 3;
        double c = (q[j] - p[j]) * (r[k] - p[k]) - (q[k] - p[k]) * (r[j] - p[j]);
        c2 += c * c;
    }
    return 0.5 * sqrt(c2);
}

/* Adds what a triangle shows of its texture's alpha. */
static void sample_triangle(const struct raw_model *raw, const struct raw_triangle *t, struct part *part)
{
    const struct raw_material *m = &raw->materials[t->material];
    const struct raw_texture *texture = m->texture == RAW_NO_TEXTURE ? NULL : &raw->textures[m->texture];
    double area = triangle_area(raw, t);
    part->area += area;
    if (!texture || !texture->has_alpha || m->alpha == RAW_ALPHA_OPAQUE) {
        part->kept += area;
        part->alpha_max = 1;
        return;
    }
    uint32_t n = SAMPLES_PART / part->triangles;
    n = n < SAMPLES_TRIANGLE_MIN ? SAMPLES_TRIANGLE_MIN : n > SAMPLES_TRIANGLE_MAX ? SAMPLES_TRIANGLE_MAX : n;
    for (uint32_t k = 0; k < n; k++) {
        /* additive recurrence (Roberts 2018, R2), folded at the triangle's diagonal */
        double a = fmod(0.5 + 0.7548776662466927 * (k + 1.0), 1),
               b = fmod(0.5 + 0.5698402909980532 * (k + 1.0), 1);
        if (a + b > 1)
            a = 1 - a, b = 1 - b;
        float uv[2];
        for (int c = 0; c < 2; c++)
            uv[c] =
                (float)((1 - a - b) * (double)raw->vertices[t->v[0]].uv[c] +
                        a * (double)raw->vertices[t->v[1]].uv[c] + b * (double)raw->vertices[t->v[2]].uv[c]);
        float alpha = raw_texture_alpha(texture, uv) * m->color[3];
        part->alpha_max = fmaxf(part->alpha_max, alpha);
        *(alpha < m->cutoff ? &part->cut : &part->kept) += area / n;
    }
}

/* parent and parts (one of each a vertex) are filled; a part is at the root of its vertices. */
static void find_parts(const struct raw_model *raw, uint32_t *parent, struct part *parts)
{
    for (uint32_t i = 0; i < raw->vertex_count; i++)
        parent[i] = i;
    for (uint32_t i = 0; i < raw->triangle_count; i++) {
        unite(parent, raw->triangles[i].v[0], raw->triangles[i].v[1]);
        unite(parent, raw->triangles[i].v[0], raw->triangles[i].v[2]);
    }
    for (uint32_t i = 0; i < raw->triangle_count; i++)
        parts[find_root(parent, raw->triangles[i].v[0])].triangles++;
    for (uint32_t i = 0; i < raw->triangle_count; i++)
        sample_triangle(raw, &raw->triangles[i], &parts[find_root(parent, raw->triangles[i].v[0])]);
}

/* The sum over a material's parts. */
static struct part sum_material(const struct raw_model *raw, int material, uint32_t *parent,
                                const struct part *parts)
{
    struct part sum = {0};
    for (uint32_t i = 0; i < raw->triangle_count; i++) {
        const struct raw_triangle *t = &raw->triangles[i];
        if (t->material != material)
            continue;
        const struct part *p = &parts[find_root(parent, t->v[0])];
        double share = 1.0 / p->triangles; /* every triangle brings its share of the part */
        sum.triangles++;
        sum.area += p->area * share, sum.cut += p->cut * share, sum.kept += p->kept * share;
        sum.alpha_max = fmaxf(sum.alpha_max, p->alpha_max);
    }
    return sum;
}

static void judge(struct raw_material *m, const struct part *sum, bool sheets)
{
    int hint = raw_name_hint(m);
    bool declared = m->alpha == RAW_ALPHA_MASK || m->alpha == RAW_ALPHA_BLEND;
    m->masked = sum->cut > sum->area * (declared ? CUT_SHARE_DECLARED : CUT_SHARE_TEXTURE);
    if (m->masked && sum->kept < KEPT_SHARE_MIN * sum->area) /* faint alpha: half of the most there is */
        m->cutoff = 0.5f * sum->alpha_max;
    m->is_leaf = m->masked ? hint >= 0 : hint > 0 || (hint == 0 && sheets && may_be_cards(m));
    if (!m->masked)
        m->color[3] = 1;
}

static bool is_wood_part(const struct part *p)
{
    return p->triangles > CARD_TRIANGLES && p->cut < CUT_SHARE_WOOD * p->area;
}

/* Gives the uncut parts of an atlas a material of their own. */
static void split_wood(struct raw_model *raw, int k, uint32_t *parent, const struct part *parts)
{
    double wood = 0, all = 0;
    for (uint32_t i = 0; i < raw->triangle_count; i++)
        if (raw->triangles[i].material == k) {
            const struct part *p = &parts[find_root(parent, raw->triangles[i].v[0])];
            all += p->area / p->triangles;
            wood += is_wood_part(p) ? p->area / p->triangles : 0;
        }
    if (wood <= 0 || wood >= all)
        return;
    struct raw_material *m = &raw->materials[raw->material_count];
    *m = raw->materials[k];
    m->is_leaf = m->masked = false;
    m->color[3] = 1;
    for (uint32_t i = 0; i < raw->triangle_count; i++)
        if (raw->triangles[i].material == k &&
            is_wood_part(&parts[find_root(parent, raw->triangles[i].v[0])]))
            raw->triangles[i].material = raw->material_count;
    raw->material_count++;
}

/* Leaves in what is leaf by now: a part of few triangles is a leaf, larger ones count by their quads. */
static uint32_t count_leaves(const struct raw_model *raw, uint32_t *parent, const struct part *parts)
{
    double cards = 0;
    uint32_t quads = 0;
    for (uint32_t i = 0; i < raw->triangle_count; i++) {
        const struct raw_triangle *t = &raw->triangles[i];
        if (!raw->materials[t->material].is_leaf)
            continue;
        const struct part *p = &parts[find_root(parent, t->v[0])];
        if (p->triangles <= CARD_TRIANGLES)
            cards += 1.0 / p->triangles;
        else
            quads++;
    }
    return (uint32_t)lround(cards) + (quads + 1) / 2;
}

static enum sv_status judge_all(struct raw_model *raw, uint32_t *parent, const struct part *parts,
                                struct sv_error *error)
{
    int count = raw->material_count;
    bool any = false;
    for (int k = 0; k < count; k++) {
        struct part sum = sum_material(raw, k, parent, parts);
        double open = 0;
        enum sv_status status = raw_open_share(raw, k, NULL, &open, error);
        if (status != SV_OK)
            return status;
        judge(&raw->materials[k], &sum, open >= SHEET_SHARE);
        any = any || raw->materials[k].is_leaf;
    }
    for (int k = 0; k < count && !any; k++) /* "bark" that is cut out in a tree without other leaves */
        raw->materials[k].is_leaf = raw->materials[k].masked;
    for (int k = 0; k < count; k++)
        if (raw->materials[k].masked && raw->materials[k].is_leaf && raw_name_hint(&raw->materials[k]) <= 0)
            split_wood(raw, k, parent, parts);
    return SV_OK;
}

static enum sv_status start_parts(const struct raw_model *raw, uint32_t **parent, struct part **parts,
                                  struct sv_error *error)
{
    *parent = malloc(((size_t)raw->vertex_count + 1) * sizeof **parent);
    *parts = calloc((size_t)raw->vertex_count + 1, sizeof **parts);
    if (!*parent || !*parts)
        return sv_fail(error, SV_ENOMEM, NULL, "no memory for %u vertices", raw->vertex_count);
    find_parts(raw, *parent, *parts);
    return SV_OK;
}

enum sv_status raw_find_masks(struct raw_model *raw, struct sv_error *error)
{
    uint32_t *parent = NULL;
    struct part *parts = NULL;
    enum sv_status status = start_parts(raw, &parent, &parts, error);
    for (int k = 0; status == SV_OK && k < raw->material_count; k++) {
        struct part sum = sum_material(raw, k, parent, parts);
        judge(&raw->materials[k], &sum, false);
        raw->materials[k].is_leaf = false;
    }
    free(parent);
    free(parts);
    return status;
}

enum sv_status raw_find_leaves(struct raw_model *raw, uint32_t *leaf_count, struct sv_error *error)
{
    uint32_t *parent = NULL;
    struct part *parts = NULL;
    enum sv_status status = start_parts(raw, &parent, &parts, error);
    if (status == SV_OK)
        status = judge_all(raw, parent, parts, error);
    if (status == SV_OK)
        *leaf_count = count_leaves(raw, parent, parts);
    free(parent);
    free(parts);
    return status;
}
