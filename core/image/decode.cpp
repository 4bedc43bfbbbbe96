/* decode.cpp - bytes of a picture to pixels, by OpenImageIO out of memory (WebP by libwebp: webp.c; SGI:
 * sgi.c).
 *
 * The format is told by the bytes themselves, by the extension only where there is no magic (TGA), and only
 * formats of the table are tried: OpenImageIO would otherwise offer unknown bytes to every reader it has,
 * films included. A texture comes out as straight sRGB: integers are taken as they are, floats as linear
 * light; exr's premultiplied colour is divided. Not in the table: PSD, whose reader takes gigabytes on
 * the word of a broken header before it can be asked for its size. */
#include "core/image/oiio.hpp"

#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include <fcntl.h>
#include <strings.h>
#include <sys/stat.h>
#include <unistd.h>

using namespace OIIO;

namespace
{

using decoder = enum sv_status (*)(const void *, size_t, struct sv_image *, struct sv_error *);
using checker = enum sv_status (*)(const void *, size_t, struct sv_error *);

struct Reader {
    const char *plugin;
    const char *magic; /* NULL: told by extension only */
    int magic_size, magic_offset;
    size_t expansion; /* most bytes of pixels that a byte of file can hold: a broken header must not claim
                         more */
    decoder own;      /* ours; NULL: OpenImageIO's plugin */
    checker check = nullptr; /* what the plugin takes on trust */
};

/* Deflate reaches 1030; what JPEG, WebP, EXR and LZW reach is not bounded by their format, but in practice.
 */
constexpr size_t DENSE = 2000;

const Reader readers[] = {
    {"png", "\x89PNG\r\n\x1a\n", 8, 0, DENSE, nullptr},
    {"jpeg", "\xff\xd8\xff", 3, 0, DENSE, nullptr},
    {"tiff", "II*\0", 4, 0, DENSE, nullptr},
    {"tiff", "MM\0*", 4, 0, DENSE, nullptr},
    {"tiff", "II+\0", 4, 0, DENSE, nullptr},
    {"tiff", "MM\0+", 4, 0, DENSE, nullptr},
    {"webp", "WEBP", 4, 8, 0, sv_webp_decode},
    {"openexr", "\x76\x2f\x31\x01", 4, 0, DENSE, nullptr, sv_exr_check},
    {"sgi", "\x01\xda", 2, 0, 0, sv_sgi_decode},
    {"dds", "DDS ", 4, 0, 0, sv_dds_decode},
    {"bmp", "BM", 2, 0, 400, nullptr}, /* RLE8: 2 bytes, 255 pixels of 3 */
    {"gif", "GIF8", 4, 0, DENSE, nullptr},
    {"hdr", "#?RADIANCE", 10, 0, 256, nullptr}, /* 2 bytes: 127 of 4 parts of 12 bytes */
    {"hdr", "#?RGBE", 6, 0, 256, nullptr},
    {"pnm", "P6", 2, 0, 1, nullptr},
    {"pnm", "P5", 2, 0, 1, nullptr},
    {"targa", nullptr, 0, 0, 0, sv_tga_decode},
};

/* Larger than this is no texture. */
constexpr size_t FILE_BYTES_MAX = (size_t)1 << 30;

const Reader *find_reader(const unsigned char *bytes, size_t size, const char *extension)
{
    for (const Reader &r : readers)
        if (r.magic && size >= (size_t)(r.magic_size + r.magic_offset) &&
            !memcmp(bytes + r.magic_offset, r.magic, (size_t)r.magic_size))
            return &r;
    bool targa = extension && (!strcasecmp(extension, "tga") || !strcasecmp(extension, "tpic"));
    return targa ? &readers[sizeof readers / sizeof *readers - 1] : nullptr;
}

/* An open picture; members die in the right order. One of our own decoders has no input. */
struct Source {
    std::unique_ptr<Filesystem::IOMemReader> memory;
    std::unique_ptr<ImageInput> input;
    const Reader *reader = nullptr;
    size_t size = 0; /* of the bytes */
};

enum sv_status open_source(const void *bytes, size_t size, const char *extension, Source &source,
                           struct sv_error *error)
{
    const Reader *reader = bytes ? find_reader((const unsigned char *)bytes, size, extension) : nullptr;
    if (!reader)
        return sv_fail(error, SV_EFORMAT, "image", "%zu bytes of no known picture format%s%s", size,
                       extension ? ", extension " : "", extension ? extension : "");
    source.reader = reader;
    source.size = size;
    if (reader->own)
        return SV_OK;
    enum sv_status status = reader->check ? reader->check(bytes, size, error) : SV_OK;
    if (status != SV_OK)
        return status;
    source.input = ImageInput::create(reader->plugin);
    if (!source.input)
        return sv_fail(error, SV_EUNSUPPORTED, "image", "OpenImageIO has no reader for %s", reader->plugin);
    source.memory = std::make_unique<Filesystem::IOMemReader>(bytes, size);
    void *proxy = source.memory.get();
    ImageSpec opened, config;
    config.attribute("oiio:UnassociatedAlpha", 1);
    config.attribute("oiio:ioproxy", TypeDesc::PTR, &proxy);
    if (!source.input->open(std::string("memory.") + reader->plugin, opened, config))
        return sv_fail(error, SV_EFORMAT, "image", "%s: %s", reader->plugin,
                       source.input->geterror().c_str());
    const ImageSpec &spec = source.input->spec(); /* what is read by; the one that open gives may differ */
    if (spec.width < 1 || spec.height < 1 || spec.nchannels < 1 || spec.depth > 1)
        return sv_fail(error, SV_EFORMAT, "image", "%s of %d x %d x %d with %d channels", reader->plugin,
                       spec.width, spec.height, spec.depth, spec.nchannels);
    return SV_OK;
}

enum sv_status read_pixels(Source &source, int first, int end, TypeDesc type, void *data,
                           struct sv_error *error)
{
    if (!source.input->read_image(0, 0, first, end, type, data))
        return sv_fail(error, SV_EFORMAT, "image", "%s: %s", source.reader->plugin,
                       source.input->geterror().c_str());
    return SV_OK;
}

enum sv_pixel_type raw_type(TypeDesc format)
{
    switch (format.basetype) {
    case TypeDesc::UINT8:
        return SV_PIXEL_U8;
    case TypeDesc::UINT16:
        return SV_PIXEL_U16;
    case TypeDesc::UINT32:
        return SV_PIXEL_U32;
    default:
        return SV_PIXEL_F32;
    }
}

TypeDesc oiio_type(enum sv_pixel_type type)
{
    static const TypeDesc::BASETYPE types[] = {TypeDesc::UINT8, TypeDesc::UINT16, TypeDesc::UINT32,
                                               TypeDesc::FLOAT};
    return types[type];
}

/* How a file's channels make up a colour: indices, -1 for no alpha. */
struct Channels {
    int color[3], alpha, end; /* read [0, end) */
};

Channels color_channels(const ImageSpec &spec)
{
    Channels c = {{0, 0, 0}, -1, 1};
    if (spec.nchannels >= 3)
        c.color[1] = 1, c.color[2] = 2;
    int named[3] = {spec.channelindex("R"), spec.channelindex("G"), spec.channelindex("B")};
    if (named[0] >= 0 && named[1] >= 0 && named[2] >= 0)
        memcpy(c.color, named, sizeof named);
    if (spec.alpha_channel >= 0 && spec.alpha_channel < spec.nchannels && spec.nchannels > 1)
        c.alpha = spec.alpha_channel;
    else if (spec.nchannels == 2 || spec.nchannels == 4)
        c.alpha = spec.nchannels - 1;
    for (int k = 0; k < 3; k++)
        c.end = c.color[k] >= c.end ? c.color[k] + 1 : c.end;
    c.end = c.alpha >= c.end ? c.alpha + 1 : c.end;
    return c;
}

/* A picture read as far as its colour goes: samples of one type, interleaved. */
struct Loaded {
    sv_image image = {};
    Channels channels = {};
    bool premultiplied = false;
    Loaded() = default;
    Loaded(const Loaded &) = delete;
    Loaded &operator=(const Loaded &) = delete;
    ~Loaded()
    {
        sv_image_free(&image);
    }
};

float unit(float v)
{
    return v > 0 ? (v < 1 ? v : 1) : 0; /* NaN: 0 */
}

float sample(const Loaded &l, size_t pixel, int channel)
{
    size_t i = pixel * (size_t)l.image.channels + (size_t)channel;
    if (l.image.type == SV_PIXEL_U8)
        return ((const unsigned char *)l.image.data)[i] / 255.0f;
    if (l.image.type == SV_PIXEL_U16)
        return ((const uint16_t *)l.image.data)[i] / 65535.0f;
    return ((const float *)l.image.data)[i];
}

/* Linear light and alpha, straight, colour >= 0. */
void texel_linear(const Loaded &l, size_t pixel, float rgba[4])
{
    rgba[3] = l.channels.alpha < 0 ? 1.0f : unit(sample(l, pixel, l.channels.alpha));
    for (int k = 0; k < 3; k++) {
        float v = sample(l, pixel, l.channels.color[k]);
        if (l.image.type == SV_PIXEL_U8)
            v = sv_linear_from_srgb8[(int)(v * 255.0f + 0.5f)];
        else if (l.image.type == SV_PIXEL_U16)
            v = sv_linear_from_srgb(v);
        else if (l.premultiplied && rgba[3] > 0)
            v /= rgba[3];
        rgba[k] = v > 0 ? v : 0;
    }
}

void texel_store(const float v[4], unsigned char rgba[4])
{
    for (int k = 0; k < 3; k++)
        rgba[k] = sv_srgb8_from_linear(v[k]);
    rgba[3] = (unsigned char)(unit(v[3]) * 255.0f + 0.5f);
}

/* u8 goes through untouched. */
void texel_srgb8(const Loaded &l, size_t pixel, unsigned char rgba[4])
{
    if (l.image.type == SV_PIXEL_U8) {
        const unsigned char *p = (const unsigned char *)l.image.data + pixel * (size_t)l.image.channels;
        for (int k = 0; k < 3; k++)
            rgba[k] = p[l.channels.color[k]];
        rgba[3] = l.channels.alpha < 0 ? 255 : p[l.channels.alpha];
        return;
    }
    float v[4];
    texel_linear(l, pixel, v);
    texel_store(v, rgba);
}

struct Box {
    int x0, x1, y0, y1; /* pixels [x0, x1) x [y0, y1) */
};

/* Area average, colour weighted by alpha, in linear light. */
void average(const Loaded &l, const Box &box, unsigned char rgba[4])
{
    double sum[4] = {0, 0, 0, 0}, plain[3] = {0, 0, 0};
    for (int y = box.y0; y < box.y1; y++)
        for (int x = box.x0; x < box.x1; x++) {
            float v[4];
            texel_linear(l, (size_t)y * (size_t)l.image.width + (size_t)x, v);
            for (int k = 0; k < 3; k++) {
                sum[k] += (double)v[k] * v[3];
                plain[k] += v[k];
            }
            sum[3] += v[3];
        }
    double count = (double)(box.x1 - box.x0) * (box.y1 - box.y0);
    float mean[4] = {0, 0, 0, (float)(sum[3] / count)};
    for (int k = 0; k < 3;
         k++) /* where all is transparent the colour beneath is kept: it bleeds into neighbours */
        mean[k] = (float)(sum[3] > 0 ? sum[k] / sum[3] : plain[k] / count);
    texel_store(mean, rgba);
}

enum sv_status shrink(const Loaded &l, int max_side, sv_image &rgba, struct sv_error *error)
{
    int64_t w = l.image.width, h = l.image.height, side = w > h ? w : h;
    bool same = side <= max_side;
    int width = (int)(same ? w : w * max_side / side), height = (int)(same ? h : h * max_side / side);
    width = width < 1 ? 1 : width;
    height = height < 1 ? 1 : height;
    sv_image out = {};
    enum sv_status status = sv_image_alloc(width, height, 4, SV_PIXEL_U8, &out, error);
    if (status != SV_OK)
        return status;
    auto *to = (unsigned char *)out.data;
    for (int y = 0; y < height; y++)
        for (int x = 0; x < width; x++, to += 4) {
            if (same)
                texel_srgb8(l, (size_t)y * (size_t)width + (size_t)x, to);
            else
                average(l,
                        {(int)(x * w / width), (int)((x + 1) * w / width), (int)(y * h / height),
                         (int)((y + 1) * h / height)},
                        to);
        }
    rgba = out;
    return SV_OK;
}

/* Reads the colour channels of what OpenImageIO opened. */
enum sv_status load(Source &source, Loaded &l, struct sv_error *error)
{
    const ImageSpec &spec = source.input->spec();
    l.channels = color_channels(spec);
    if (l.channels.end > 16)
        return sv_fail(error, SV_ELIMIT, "image", "colour in channel %d: over 16", l.channels.end);
    enum sv_pixel_type type = spec.channelformats.empty() ? raw_type(spec.format) : SV_PIXEL_F32;
    type = type == SV_PIXEL_U32 ? SV_PIXEL_F32 : type;
    enum sv_status status =
        sv_image_check_claim(spec.width, spec.height, l.channels.end, sv_pixel_bytes(type), source.size,
                             source.reader->expansion, error);
    if (status != SV_OK)
        return status;
    status = sv_image_alloc(spec.width, spec.height, l.channels.end, type, &l.image,
                            error); /* zeros, not yet touched */
    if (status != SV_OK)
        return status;
    l.premultiplied = !strcmp(source.reader->plugin, "openexr");
    return read_pixels(source, 0, l.channels.end, oiio_type(type), l.image.data, error);
}

enum sv_status decode_rgba(const void *bytes, size_t size, const char *extension, int max_side,
                           sv_image &rgba, bool *has_alpha, struct sv_error *error)
{
    Source source;
    enum sv_status status = open_source(bytes, size, extension, source, error);
    if (status != SV_OK)
        return status;
    Loaded l;
    if (source.input) {
        status = load(source, l, error);
    } else {
        status = source.reader->own(bytes, size, &l.image, error);
        int n = l.image.channels;
        l.channels = {{0, n < 3 ? 0 : 1, n < 3 ? 0 : 2}, n == 2 || n == 4 ? n - 1 : -1, n};
    }
    if (status == SV_OK)
        status = shrink(l, max_side, rgba, error);
    if (status == SV_OK && has_alpha)
        *has_alpha = l.channels.alpha >= 0;
    return status;
}

/* Channels [first, end) of the picture in one type. */
enum sv_status decode_range(Source &source, int first, int end, enum sv_pixel_type type, sv_image &image,
                            struct sv_error *error)
{
    const ImageSpec &spec = source.input->spec();
    enum sv_status status = sv_image_check_claim(spec.width, spec.height, end - first, sv_pixel_bytes(type),
                                                 source.size, source.reader->expansion, error);
    if (status != SV_OK)
        return status;
    sv_image out = {};
    status = sv_image_alloc(spec.width, spec.height, end - first, type, &out, error);
    if (status != SV_OK)
        return status;
    std::unique_ptr<void, decltype(&free)> guard(out.data, free); /* the reader may throw */
    status = read_pixels(source, first, end, oiio_type(type), out.data, error);
    if (status != SV_OK)
        return status;
    (void)guard.release();
    image = out;
    return SV_OK;
}

/* The whole file in memory. */
enum sv_status read_file(const char *path, std::vector<unsigned char> &bytes, struct sv_error *error)
{
    int fd = open(path, O_RDONLY | O_CLOEXEC);
    if (fd < 0)
        return sv_fail(error, errno == ENOENT || errno == ENOTDIR ? SV_ENOENT : SV_EIO, path, "%s",
                       strerror(errno));
    struct stat st;
    enum sv_status status = SV_OK;
    if (fstat(fd, &st) != 0)
        status = sv_fail(error, SV_EIO, path, "%s", strerror(errno));
    else if (!S_ISREG(st.st_mode))
        status = sv_fail(error, SV_EFORMAT, path, "not a regular file");
    else if ((size_t)st.st_size > FILE_BYTES_MAX)
        status =
            sv_fail(error, SV_ELIMIT, path, "%lld bytes, over %zu", (long long)st.st_size, FILE_BYTES_MAX);
    size_t have = 0;
    if (status == SV_OK) {
        try {
            bytes.resize((size_t)st.st_size);
        } catch (const std::bad_alloc &) {
            status = sv_fail(error, SV_ENOMEM, path, "no memory for %lld bytes", (long long)st.st_size);
        }
    }
    while (status == SV_OK && have < bytes.size()) {
        ssize_t n = read(fd, bytes.data() + have, bytes.size() - have);
        if (n < 0)
            status = sv_fail(error, SV_EIO, path, "%s", strerror(errno));
        else if (n == 0)
            bytes.resize(have);
        else
            have += (size_t)n;
    }
    close(fd);
    return status;
}

} // namespace

constexpr size_t PIXEL_BYTES_MAX = (size_t)2 << 30, CLAIM_FREE_BYTES = 1 << 20;

enum sv_status sv_image_check_claim(int width, int height, int channels, size_t sample_bytes,
                                    size_t file_bytes, size_t expansion, struct sv_error *error)
{
    if (width > SV_DECODE_SIDE_MAX || height > SV_DECODE_SIDE_MAX)
        return sv_fail(error, SV_ELIMIT, "image", "%d x %d is over %d a side", width, height,
                       SV_DECODE_SIDE_MAX);
    size_t need = (size_t)width * (size_t)height * (size_t)channels * sample_bytes;
    if (need > PIXEL_BYTES_MAX)
        return sv_fail(error, SV_ELIMIT, "image", "%d x %d with %d channels takes %zu bytes, over %zu", width,
                       height, channels, need, PIXEL_BYTES_MAX);
    if (need > CLAIM_FREE_BYTES && need / expansion > file_bytes)
        return sv_fail(error, SV_ELIMIT, "image", "%zu bytes claim to hold %zu bytes of pixels", file_bytes,
                       need);
    return SV_OK;
}

enum sv_status sv_image_decode_bytes(const void *bytes, size_t size, const char *extension, int max_side,
                                     struct sv_image *rgba, bool *has_alpha, struct sv_error *error)
{
    if (max_side < 1)
        return sv_fail(error, SV_EINVAL, "max_side", "%d is below 1", max_side);
    return sv_image_fenced(
        error, "decode", [&]() -> enum sv_status {
            return decode_rgba(bytes, size, extension, max_side, *rgba, has_alpha, error);
        });
}

enum sv_status sv_image_decode_file(const char *path, int max_side, struct sv_image *rgba, bool *has_alpha,
                                    struct sv_error *error)
{
    return sv_image_fenced(
        error, path, [&]() -> enum sv_status {
            std::vector<unsigned char> bytes;
            enum sv_status status = read_file(path, bytes, error);
            if (status != SV_OK)
                return status;
            const char *slash = strrchr(path, '/'), *dot = strrchr(path, '.');
            const char *extension = dot && (!slash || dot > slash) ? dot + 1 : nullptr;
            status = sv_image_decode_bytes(bytes.data(), bytes.size(), extension, max_side, rgba, has_alpha,
                                           error);
            if (status != SV_OK && error) /* name the file, not the parameter */
                snprintf(error->field, sizeof error->field, "%s", path);
            return status;
        });
}

enum sv_status sv_image_decode_raw(const void *bytes, size_t size, const char *extension,
                                   struct sv_image *image, struct sv_error *error)
{
    return sv_image_fenced(
        error, "decode", [&]() -> enum sv_status {
            Source source;
            enum sv_status status = open_source(bytes, size, extension, source, error);
            if (status != SV_OK)
                return status;
            const ImageSpec &spec = source.input->spec();
            if (spec.nchannels > 16)
                return sv_fail(error, SV_ELIMIT, "image", "%d channels, over 16", spec.nchannels);
            enum sv_pixel_type type = spec.channelformats.empty() ? raw_type(spec.format) : SV_PIXEL_F32;
            return decode_range(source, 0, spec.nchannels, type, *image, error);
        });
}

enum sv_status sv_image_decode_channel(const void *bytes, size_t size, const char *extension,
                                       const char *channel, struct sv_image *image, struct sv_error *error)
{
    return sv_image_fenced(
        error, "decode", [&]() -> enum sv_status {
            Source source;
            enum sv_status status = open_source(bytes, size, extension, source, error);
            if (status != SV_OK)
                return status;
            const ImageSpec &spec = source.input->spec();
            int c = spec.channelindex(channel);
            if (c < 0)
                return sv_fail(error, SV_ENOENT, "image", "no channel '%s'", channel);
            return decode_range(source, c, c + 1, raw_type(spec.channelformat(c)), *image, error);
        });
}
