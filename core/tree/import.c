/* import.c - assimp's part of an import: a scene graph in, triangles in the file's world and plain materials
 * out.
 *
 * Node transforms are applied in double (COLLADA's up axis and unit live there); an FBX that says Z is up is
 * turned, since assimp 5.2.5 does not. A mirrored node turns its triangles' winding back. glTF colours are
 * linear factors, and so are Blender's in any format (it writes its own values down); all others are sRGB.
 * Outside of glTF a plain grey on a textured material is the exporter's default (Blender 0.8, 3ds Max 0.588),
 * not a tint: it counts as white. What is not a triangle is left out. assimp's post-processing joins equal
 * vertices and applies texture transforms. */
#include "core/tree/import.h"

#include <ctype.h>
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include <sys/stat.h>

#include <assimp/GltfMaterial.h>
#include <assimp/cimport.h>
#include <assimp/material.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>

#include "core/base/color.h"
#include "core/image/encode.h"
#include "core/tree/import_parts.h"

enum {
    NODE_DEPTH_MAX = 256,
    VARIANTS = 2, /* of each material: with texture, and plain for meshes without texture coordinates */
};
#define MODEL_BYTES_MAX ((long long)1 << 30)

struct reader {
    const char *path;
    const struct aiScene *scene;
    struct raw_model *raw;
    struct sv_errors *notes;
    struct sv_error *error;
    bool z_up, gltf, linear_colors;
    uint64_t triangles, vertices; /* counted over all instances */
    double (*color_sums)[4];      /* per assimp material: vertex colours and their count */
    int *slots;                   /* per assimp material and variant: index in raw->materials, or -1 */
};

struct affine {
    double m[3][4];
};

void raw_finish(struct raw_model *raw)
{
    for (int i = 0; i < raw->texture_count; i++) {
        free(raw->textures[i].key);
        sv_image_free(&raw->textures[i].image);
    }
    free(raw->textures);
    free(raw->materials);
    free(raw->triangles);
    free(raw->vertices);
    memset(raw, 0, sizeof *raw);
}

static struct affine chain(const struct affine *a, const struct aiMatrix4x4 *b)
{
    const float *rows = &b->a1; /* row-major, 4 x 4 */
    struct affine r;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 4; j++) {
            r.m[i][j] = j == 3 ? a->m[i][3] : 0;
            for (int k = 0; k < 3; k++)
                r.m[i][j] += a->m[i][k] * (double)rows[4 * k + j];
        }
    return r;
}

static double determinant(const struct affine *a)
{
    const double(*m)[4] = a->m;
    return m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) -
           m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0]) +
           m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0]);
}

/* Normals go by the cofactors of the matrix: the inverse transposed times the determinant, defined for flat
 * scales, too. */
static void turn_normal(const struct affine *a, const struct aiVector3D *n, float out[3])
{
    const double(*m)[4] = a->m;
    double v[3] = {(double)n->x, (double)n->y, (double)n->z}, r[3];
    for (int i = 0; i < 3; i++) {
        int j = (i + 1) % 3, k = (i + 2) % 3;
        r[i] = 0;
        for (int c = 0; c < 3; c++) {
            int d = (c + 1) % 3, e = (c + 2) % 3;
            r[i] += (m[j][d] * m[k][e] - m[j][e] * m[k][d]) * v[c];
        }
    }
    double length = sqrt(r[0] * r[0] + r[1] * r[1] + r[2] * r[2]), sign = determinant(a) < 0 ? -1 : 1;
    for (int i = 0; i < 3; i++)
        out[i] = length > 0 && isfinite(length) ? (float)(sign * r[i] / length) : 0;
}

/* Visits a mesh as a node shows it. */
typedef enum sv_status (*mesh_visitor)(struct reader *r, const struct aiMesh *mesh,
                                       const struct affine *world);

static enum sv_status visit(struct reader *r, const struct aiNode *node, const struct affine *parent,
                            int depth, mesh_visitor visitor)
{
    if (depth > NODE_DEPTH_MAX)
        return sv_fail(r->error, SV_ELIMIT, r->path, "nodes are nested deeper than %d", NODE_DEPTH_MAX);
    struct affine world = chain(parent, &node->mTransformation);
    enum sv_status status = SV_OK;
    for (unsigned i = 0; status == SV_OK && i < node->mNumMeshes; i++)
        if (node->mMeshes[i] < r->scene->mNumMeshes)
            status = visitor(r, r->scene->mMeshes[node->mMeshes[i]], &world);
    for (unsigned i = 0; status == SV_OK && i < node->mNumChildren; i++)
        status = visit(r, node->mChildren[i], &world, depth + 1, visitor);
    return status;
}

static bool is_triangle(const struct aiMesh *mesh, const struct aiFace *face)
{
    return face->mNumIndices == 3 && face->mIndices[0] < mesh->mNumVertices &&
           face->mIndices[1] < mesh->mNumVertices && face->mIndices[2] < mesh->mNumVertices;
}

static enum sv_status count_mesh(struct reader *r, const struct aiMesh *mesh, const struct affine *world)
{
    (void)world;
    uint64_t triangles = 0;
    for (unsigned i = 0; i < mesh->mNumFaces; i++)
        triangles += is_triangle(mesh, &mesh->mFaces[i]);
    if (triangles == 0)
        return SV_OK;
    r->triangles += triangles;
    r->vertices += mesh->mNumVertices;
    if (r->triangles > SV_TREE_TRIANGLES_MAX || r->vertices > SV_TREE_VERTICES_MAX)
        return sv_fail(r->error, SV_ELIMIT, r->path, "over %d triangles or %d vertices",
                       SV_TREE_TRIANGLES_MAX, SV_TREE_VERTICES_MAX);
    unsigned material = mesh->mMaterialIndex;
    for (unsigned i = 0; mesh->mColors[0] && material < r->scene->mNumMaterials && i < mesh->mNumVertices;
         i++) {
        const struct aiColor4D *c = &mesh->mColors[0][i];
        double *sum = r->color_sums[material];
        if (!isfinite(c->r + c->g + c->b))
            continue;
        sum[0] += (double)c->r, sum[1] += (double)c->g, sum[2] += (double)c->b, sum[3] += 1;
    }
    return SV_OK;
}

static void lower_append(char *hint, const char *text)
{
    size_t n = strlen(hint);
    for (; *text && n + 2 < RAW_HINT_BYTES; text++)
        hint[n++] = (char)tolower((unsigned char)*text);
    hint[n++] = ' ';
    hint[n] = 0;
}

/* The name of a material's texture of one kind; false when it has none. */
static bool texture_name(const struct aiMaterial *m, enum aiTextureType type, struct aiString *name)
{
    return aiGetMaterialString(m, AI_MATKEY_TEXTURE(type, 0), name) == aiReturn_SUCCESS && name->length > 0;
}

static const char *last_part(const char *path)
{
    const char *slash = strrchr(path, '/'), *back = strrchr(path, '\\');
    const char *last = slash > back ? slash : back;
    return last ? last + 1 : path;
}

/* The embedded texture of that name: "*n", or (FBX) the name of the file that it once was. */
static const struct aiTexture *embedded(const struct aiScene *scene, const char *name)
{
    if (name[0] == '*') {
        char *end;
        long n = strtol(name + 1, &end, 10);
        return !*end && end > name + 1 && n >= 0 && n < (long)scene->mNumTextures ? scene->mTextures[n]
                                                                                  : NULL;
    }
    for (unsigned i = 0; i < scene->mNumTextures; i++)
        if (scene->mTextures[i]->mFilename.length &&
            strcmp(last_part(scene->mTextures[i]->mFilename.data), last_part(name)) == 0)
            return scene->mTextures[i];
    return NULL;
}

static struct raw_texture_source make_source(const struct reader *r, const char *material, const char *name)
{
    struct raw_texture_source s = {.model_path = r->path, .material = material, .name = name};
    const struct aiTexture *t = embedded(r->scene, name);
    if (t && t->mHeight == 0) {
        s.bytes = t->pcData;
        s.size = t->mWidth;
        s.extension = t->achFormatHint;
    } else if (t && t->mWidth <= SV_TREE_TEXTURE_SIDE_MAX && t->mHeight <= SV_TREE_TEXTURE_SIDE_MAX) {
        s.bgra = (struct sv_image){(int)t->mWidth, (int)t->mHeight, 4, SV_PIXEL_U8, t->pcData};
    }
    return s;
}

static enum sv_status read_textures(struct reader *r, const struct aiMaterial *m, struct raw_material *out)
{
    struct aiString color, opacity;
    bool has_color =
        texture_name(m, aiTextureType_BASE_COLOR, &color) || texture_name(m, aiTextureType_DIFFUSE, &color);
    bool has_opacity = texture_name(m, aiTextureType_OPACITY, &opacity);
    struct raw_texture_source sources[2] = {{0}, {0}};
    if (has_color) {
        sources[0] = make_source(r, out->name, color.data);
        lower_append(out->hint, last_part(color.data));
    }
    if (has_opacity)
        sources[1] = make_source(r, out->name, opacity.data);
    return raw_texture_load(r->raw, has_color ? &sources[0] : NULL, has_opacity ? &sources[1] : NULL,
                            &out->texture, r->notes, r->error);
}

static float finite_or(float v, float otherwise)
{
    return isfinite(v) ? fminf(fmaxf(v, 0), 1000) : otherwise;
}

static void read_color(const struct reader *r, const struct aiMaterial *m, unsigned index,
                       struct raw_material *out)
{
    struct aiColor4D c = {1, 1, 1, 1};
    if (aiGetMaterialColor(m, AI_MATKEY_BASE_COLOR, &c) != aiReturn_SUCCESS &&
        aiGetMaterialColor(m, AI_MATKEY_COLOR_DIFFUSE, &c) != aiReturn_SUCCESS)
        c = (struct aiColor4D){1, 1, 1, 1};
    float rgb[3] = {finite_or(c.r, 1), finite_or(c.g, 1), finite_or(c.b, 1)};
    float spread = fmaxf(fmaxf(rgb[0], rgb[1]), rgb[2]) - fminf(fminf(rgb[0], rgb[1]), rgb[2]);
    bool default_grey = !r->gltf && out->texture != RAW_NO_TEXTURE && spread < 0.02f;
    const double *sum = r->color_sums[index];
    for (int k = 0; k < 3; k++) {
        float v = default_grey ? 1 : r->linear_colors ? rgb[k] : sv_linear_from_srgb(rgb[k]);
        if (sum[3] > 0 && out->texture == RAW_NO_TEXTURE) {
            float mean = finite_or((float)(sum[k] / sum[3]), 1);
            v *= r->linear_colors ? mean : sv_linear_from_srgb(mean);
        }
        out->color[k] = v;
    }
    float opacity = 1;
    if (aiGetMaterialFloatArray(m, AI_MATKEY_OPACITY, &opacity, NULL) != aiReturn_SUCCESS)
        opacity = 1;
    /* An opacity of 0 is a confused exporter (FBX, COLLADA), not an invisible tree; only glTF means its
     * factor with a mask. */
    out->color[3] = r->gltf && opacity > 0 && opacity <= 1 ? opacity : 1;
}

static void read_alpha(const struct aiMaterial *m, struct raw_material *out)
{
    static const struct {
        const char *name;
        enum raw_alpha alpha;
    } modes[] = {{"OPAQUE", RAW_ALPHA_OPAQUE}, {"MASK", RAW_ALPHA_MASK}, {"BLEND", RAW_ALPHA_BLEND}};
    struct aiString mode;
    out->alpha = RAW_ALPHA_FROM_TEXTURE;
    out->cutoff = 0.5f;
    if (aiGetMaterialString(m, AI_MATKEY_GLTF_ALPHAMODE, &mode) == aiReturn_SUCCESS)
        for (size_t i = 0; i < sizeof modes / sizeof *modes; i++)
            if (strcmp(mode.data, modes[i].name) == 0)
                out->alpha = modes[i].alpha;
    float cutoff = 0.5f;
    if (out->alpha == RAW_ALPHA_MASK &&
        aiGetMaterialFloatArray(m, AI_MATKEY_GLTF_ALPHACUTOFF, &cutoff, NULL) == aiReturn_SUCCESS)
        out->cutoff = isfinite(cutoff) ? fminf(fmaxf(cutoff, 0), 1) : 0.5f;
    int two_sided = 0;
    out->two_sided =
        aiGetMaterialIntegerArray(m, AI_MATKEY_TWOSIDED, &two_sided, NULL) == aiReturn_SUCCESS && two_sided;
}

static bool same_material(const struct raw_material *a, const struct raw_material *b)
{
    return a->texture == b->texture && memcmp(a->color, b->color, sizeof a->color) == 0 &&
           a->alpha == b->alpha && a->cutoff == b->cutoff && a->two_sided == b->two_sided &&
           raw_name_hint(a) == raw_name_hint(b);
}

/* The raw material for an assimp material's variant; made when first asked for, shared where equal. */
static enum sv_status material_slot(struct reader *r, const struct aiMesh *mesh, int32_t *slot)
{
    unsigned index = mesh->mMaterialIndex < r->scene->mNumMaterials ? mesh->mMaterialIndex : 0;
    bool plain = !mesh->mTextureCoords[0];
    int *known = &r->slots[index * VARIANTS + plain];
    if (*known < 0) {
        const struct aiMaterial *m = r->scene->mMaterials[index];
        struct raw_material made = {.texture = RAW_NO_TEXTURE};
        struct aiString name;
        if (aiGetMaterialString(m, AI_MATKEY_NAME, &name) == aiReturn_SUCCESS) {
            snprintf(made.name, sizeof made.name, "%.*s", (int)sizeof made.name - 1, name.data);
            lower_append(made.hint, name.data);
        }
        lower_append(made.mesh_hint, mesh->mName.data);
        enum sv_status status = plain ? SV_OK : read_textures(r, m, &made);
        if (status != SV_OK)
            return status;
        read_color(r, m, index, &made);
        read_alpha(m, &made);
        int at = 0;
        while (at < r->raw->material_count && !same_material(&r->raw->materials[at], &made))
            at++;
        if (at == r->raw->material_count)
            r->raw->materials[r->raw->material_count++] = made;
        *known = at;
    }
    *slot = *known;
    return SV_OK;
}

/* The channel of texture coordinates that the colour texture wants. */
static const struct aiVector3D *texture_coordinates(const struct reader *r, const struct aiMesh *mesh)
{
    int channel = 0;
    if (mesh->mMaterialIndex < r->scene->mNumMaterials) {
        const struct aiMaterial *m = r->scene->mMaterials[mesh->mMaterialIndex];
        if (aiGetMaterialIntegerArray(m, AI_MATKEY_UVWSRC(aiTextureType_BASE_COLOR, 0), &channel, NULL) !=
                aiReturn_SUCCESS &&
            aiGetMaterialIntegerArray(m, AI_MATKEY_UVWSRC(aiTextureType_DIFFUSE, 0), &channel, NULL) !=
                aiReturn_SUCCESS)
            channel = 0;
    }
    bool legal = channel >= 0 && channel < AI_MAX_NUMBER_OF_TEXTURECOORDS && mesh->mTextureCoords[channel];
    return mesh->mTextureCoords[legal ? channel : 0];
}

static void read_vertex(const struct reader *r, const struct aiMesh *mesh, const struct aiVector3D *uv,
                        unsigned i, const struct affine *world, struct raw_vertex *out)
{
    const struct aiVector3D *p = &mesh->mVertices[i];
    for (int a = 0; a < 3; a++)
        out->p[a] = world->m[a][0] * (double)p->x + world->m[a][1] * (double)p->y +
                    world->m[a][2] * (double)p->z + world->m[a][3];
    if (mesh->mNormals)
        turn_normal(world, &mesh->mNormals[i], out->n);
    if (uv && isfinite(uv[i].x) && isfinite(uv[i].y)) {
        out->uv[0] = uv[i].x;
        out->uv[1] = 1 - uv[i].y;
    }
    for (int a = 0; a < 2; a++) /* so far out a float holds no fraction */
        out->uv[a] = fabsf(out->uv[a]) < 65536 ? out->uv[a] : 0;
    if (r->z_up) { /* (x, y, z) with Z up -> (x, z, -y) with Y up */
        double y = out->p[1];
        out->p[1] = out->p[2], out->p[2] = -y;
        float n = out->n[1];
        out->n[1] = out->n[2], out->n[2] = -n;
    }
}

static bool is_finite3(const double p[3])
{
    return isfinite(p[0]) && isfinite(p[1]) && isfinite(p[2]);
}

/* Without area, up to rounding: the cross product of two edges is nothing beside their lengths. */
static bool is_degenerate(const double *p, const double *q, const double *r)
{
    double a[3], b[3], c[3], aa = 0, bb = 0, cc = 0;
    for (int k = 0; k < 3; k++)
        a[k] = q[k] - p[k], b[k] = r[k] - p[k], aa += a[k] * a[k], bb += b[k] * b[k];
    for (int k = 0; k < 3; k++) {
        c[k] = a[(k + 1) % 3] * b[(k + 2) % 3] - a[(k + 2) % 3] * b[(k + 1) % 3];
        cc += c[k] * c[k];
    }
    return !(cc > 1e-24 * aa * bb); /* the sine of the angle is at most 1e-12 */
}

static enum sv_status read_mesh(struct reader *r, const struct aiMesh *mesh, const struct affine *world)
{
    struct raw_model *raw = r->raw;
    uint32_t first = raw->vertex_count;
    bool used = false;
    for (unsigned i = 0; i < mesh->mNumFaces && !used; i++)
        used = is_triangle(mesh, &mesh->mFaces[i]);
    if (!used)
        return SV_OK;
    int32_t material;
    enum sv_status status = material_slot(r, mesh, &material);
    if (status != SV_OK)
        return status;
    const struct aiVector3D *uv = texture_coordinates(r, mesh);
    for (unsigned i = 0; i < mesh->mNumVertices; i++)
        read_vertex(r, mesh, uv, i, world, &raw->vertices[raw->vertex_count++]);
    bool mirrored = determinant(world) < 0;
    for (unsigned i = 0; i < mesh->mNumFaces; i++) {
        const struct aiFace *face = &mesh->mFaces[i];
        if (!is_triangle(mesh, face))
            continue;
        uint32_t a = first + face->mIndices[0], b = first + face->mIndices[mirrored ? 2 : 1],
                 c = first + face->mIndices[mirrored ? 1 : 2];
        const double *p = raw->vertices[a].p, *q = raw->vertices[b].p, *s = raw->vertices[c].p;
        if (!is_finite3(p) || !is_finite3(q) || !is_finite3(s))
            raw->dropped_broken++;
        else if (is_degenerate(p, q, s))
            raw->dropped_degenerate++;
        else
            raw->triangles[raw->triangle_count++] = (struct raw_triangle){{a, b, c}, material};
    }
    return SV_OK;
}

static bool metadata_is(const struct aiScene *scene, const char *key, int32_t wanted)
{
    for (unsigned i = 0; scene->mMetaData && i < scene->mMetaData->mNumProperties; i++)
        if (strcmp(scene->mMetaData->mKeys[i].data, key) == 0 &&
            scene->mMetaData->mValues[i].mType == AI_INT32)
            return *(const int32_t *)scene->mMetaData->mValues[i].mData == wanted;
    return false;
}

static bool metadata_contains(const struct aiScene *scene, const char *key, const char *word)
{
    for (unsigned i = 0; scene->mMetaData && i < scene->mMetaData->mNumProperties; i++)
        if (strcmp(scene->mMetaData->mKeys[i].data, key) == 0 &&
            scene->mMetaData->mValues[i].mType == AI_AISTRING)
            return strstr(((const struct aiString *)scene->mMetaData->mValues[i].mData)->data, word) != NULL;
    return false;
}

/* An OBJ's material file says in its first line when Blender wrote it; assimp does not hand that on. */
static bool is_blender_mtl(const char *path)
{
    char name[4096], head[64] = "";
    const char *dot = strrchr(path, '.');
    if (!dot || strcasecmp(dot, ".obj") != 0 ||
        snprintf(name, sizeof name, "%.*s.mtl", (int)(dot - path), path) >= (int)sizeof name)
        return false;
    FILE *f = fopen(name, "re");
    bool blender = f && fgets(head, sizeof head, f) && head[0] == '#' && strstr(head, "Blender");
    if (f)
        fclose(f);
    return blender;
}

/* Makes room for what count_mesh counted, then reads. */
static enum sv_status read_counted(struct reader *r, const struct affine *identity)
{
    struct raw_model *raw = r->raw;
    size_t slots = (size_t)r->scene->mNumMaterials * VARIANTS;
    raw->vertices = calloc(r->vertices, sizeof *raw->vertices);
    raw->triangles = calloc(r->triangles, sizeof *raw->triangles);
    raw->materials = calloc(2 * slots, sizeof *raw->materials); /* each may be split in two */
    r->slots = malloc(slots * sizeof *r->slots);
    if (!raw->vertices || !raw->triangles || !raw->materials || !r->slots)
        return sv_fail(r->error, SV_ENOMEM, r->path, "no memory for %llu triangles",
                       (unsigned long long)r->triangles);
    for (size_t i = 0; i < slots; i++)
        r->slots[i] = -1;
    return visit(r, r->scene->mRootNode, identity, 0, read_mesh);
}

static enum sv_status read_scene(struct reader *r)
{
    const struct affine identity = {{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}}};
    if (!r->scene->mRootNode || r->scene->mNumMeshes == 0 || r->scene->mNumMaterials == 0)
        return sv_fail(r->error, SV_EFORMAT, r->path, "holds no triangle");
    r->z_up = metadata_contains(r->scene, "SourceAsset_Format", "FBX") && metadata_is(r->scene, "UpAxis", 2);
    r->gltf = metadata_contains(r->scene, "SourceAsset_Format", "glTF");
    r->linear_colors =
        r->gltf || metadata_contains(r->scene, "SourceAsset_Generator", "Blender") || is_blender_mtl(r->path);
    r->color_sums = calloc(r->scene->mNumMaterials, sizeof *r->color_sums);
    if (!r->color_sums)
        return sv_fail(r->error, SV_ENOMEM, r->path, "no memory for %u materials", r->scene->mNumMaterials);
    enum sv_status status = visit(r, r->scene->mRootNode, &identity, 0, count_mesh);
    if (status == SV_OK && r->triangles == 0)
        status = sv_fail(r->error, SV_EFORMAT, r->path, "holds no triangle (points or lines only)");
    if (status == SV_OK)
        status = read_counted(r, &identity);
    free(r->color_sums);
    free(r->slots);
    return status;
}

static enum sv_status check_file(const char *path, struct sv_error *error)
{
    struct stat st;
    if (stat(path, &st) != 0)
        return sv_fail(error, errno == ENOENT || errno == ENOTDIR ? SV_ENOENT : SV_EIO, path, "%s",
                       strerror(errno));
    if (!S_ISREG(st.st_mode))
        return sv_fail(error, SV_EFORMAT, path, "not a regular file");
    if ((long long)st.st_size > MODEL_BYTES_MAX)
        return sv_fail(error, SV_ELIMIT, path, "%lld bytes, over %lld", (long long)st.st_size,
                       MODEL_BYTES_MAX);
    return SV_OK;
}

static enum sv_status read_file(const char *path, struct raw_model *raw, struct sv_errors *notes,
                                struct sv_error *error)
{
    enum sv_status status = check_file(path, error);
    if (status != SV_OK)
        return status;
    const struct aiScene *scene =
        aiImportFile(path, aiProcess_Triangulate | aiProcess_JoinIdenticalVertices | aiProcess_SortByPType |
                               aiProcess_ValidateDataStructure | aiProcess_TransformUVCoords);
    if (!scene)
        return sv_fail(error, SV_EFORMAT, path, "cannot be read: %.300s", aiGetErrorString());
    struct reader reader = {.path = path, .scene = scene, .raw = raw, .notes = notes, .error = error};
    status = read_scene(&reader);
    aiReleaseImport(scene);
    return status;
}

static void note_dropped(const struct raw_model *raw, const char *path, struct sv_errors *notes)
{
    if (notes && raw->dropped_broken)
        sv_errors_add(notes, SV_EFORMAT, path, "%u triangles have a vertex that is not finite: left out",
                      raw->dropped_broken);
    if (notes && raw->dropped_degenerate)
        sv_errors_add(notes, SV_EFORMAT, path, "%u triangles have no area: left out",
                      raw->dropped_degenerate);
    if (notes && raw->triangle_count > 0 && raw->triangle_count < 4)
        sv_errors_add(notes, SV_EFORMAT, path,
                      "only %u triangles were read: is the file of a kind that assimp knows?",
                      raw->triangle_count);
}

static enum sv_status import(const char *path, bool is_object, struct sv_tree_mesh *mesh,
                             struct sv_errors *notes, struct sv_error *error)
{
    sv_image_init();
    struct raw_model raw = {.is_object = is_object};
    struct sv_tree_mesh made = {0};
    uint32_t leaves = 0;
    enum sv_status status = read_file(path, &raw, notes, error);
    if (status == SV_OK) {
        note_dropped(&raw, path, notes);
        status = is_object ? raw_find_masks(&raw, error) : raw_find_leaves(&raw, &leaves, error);
    }
    if (status == SV_OK)
        status = raw_shape(&raw, path, &made, notes, error);
    made.leaf_count = leaves;
    if (status == SV_OK)
        status = sv_tree_mesh_measure(&made, error);
    if (status == SV_OK && is_object)
        status = raw_measure_sky(&made, error);
    raw_finish(&raw);
    if (status != SV_OK)
        sv_tree_mesh_finish(&made);
    else
        *mesh = made;
    return status;
}

enum sv_status sv_tree_import(const char *path, struct sv_tree_mesh *mesh, struct sv_errors *notes,
                              struct sv_error *error)
{
    enum sv_status status = import(path, false, mesh, notes, error);
    if (status == SV_OK && notes && mesh->leaf_count == 0)
        sv_errors_add(notes, SV_ENOENT, path,
                      "no leaves found (neither by alpha nor by name): all of it is drawn as wood");
    return status;
}

enum sv_status sv_object_import(const char *path, struct sv_tree_mesh *mesh, struct sv_errors *notes,
                                struct sv_error *error)
{
    return import(path, true, mesh, notes, error);
}
