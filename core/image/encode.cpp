/* encode.cpp - pictures to bytes, by OpenImageIO into memory.
 *
 * Rows of a table say what each format can hold. A colour picture is handed over as it is (sRGB, straight
 * alpha) except to EXR, which by its standard holds linear light with premultiplied alpha. Every format's
 * writer takes an IOProxy, so no file is touched. The settings were measured: see encode.h. */
#include "core/image/oiio.hpp"

#include <cstdlib>
#include <cstring>

#include <OpenImageIO/half.h>

using namespace OIIO;

namespace
{

/* A growing block from malloc that a writer fills and the caller takes. */
class HeapOutput final : public Filesystem::IOProxy
{
  public:
    HeapOutput() : IOProxy("", Write)
    {
    }
    ~HeapOutput() override
    {
        free(data_);
    }
    const char *proxytype() const override
    {
        return "heapoutput";
    }
    size_t size() const override
    {
        return size_;
    }
    size_t write(const void *buf, size_t n) override
    {
        n = pwrite(buf, n, m_pos);
        m_pos += (int64_t)n;
        return n;
    }
    size_t pwrite(const void *buf, size_t n, int64_t offset) override
    {
        size_t end = (size_t)offset + n;
        if (offset < 0 || !reserve(end))
            return 0;
        if ((size_t)offset > size_)
            memset(data_ + size_, 0, (size_t)offset - size_);
        memcpy(data_ + offset, buf, n);
        size_ = end > size_ ? end : size_;
        return n;
    }
    size_t read(void *buf, size_t n) override
    {
        n = pread(buf, n, m_pos);
        m_pos += (int64_t)n;
        return n;
    }
    size_t pread(void *buf, size_t n, int64_t offset) override
    {
        if (offset < 0 || (size_t)offset >= size_)
            return 0;
        n = n < size_ - (size_t)offset ? n : size_ - (size_t)offset;
        memcpy(buf, data_ + offset, n);
        return n;
    }
    void *take(size_t *size)
    {
        unsigned char *data = data_;
        *size = size_;
        data_ = nullptr;
        size_ = capacity_ = 0;
        return data;
    }

  private:
    bool reserve(size_t n)
    {
        if (n <= capacity_)
            return true;
        size_t capacity = n + n / 2 + 65536;
        void *p = realloc(data_, capacity);
        if (!p)
            return false;
        data_ = (unsigned char *)p;
        capacity_ = capacity;
        return true;
    }
    unsigned char *data_ = nullptr;
    size_t size_ = 0, capacity_ = 0;
};

enum { U8 = 1 << SV_PIXEL_U8, U16 = 1 << SV_PIXEL_U16, U32 = 1 << SV_PIXEL_U32, F32 = 1 << SV_PIXEL_F32 };

struct Format {
    const char *plugin; /* OpenImageIO's name */
    unsigned types;     /* bit set of 1 << enum sv_pixel_type */
    unsigned channels;  /* bit set of 1 << channel count */
    int max_side;
};

constexpr unsigned ANY_CHANNELS = 0x1FFFE;
constexpr int PNG_FILTER_UP = 32;            /* libpng's number */
constexpr int JPEG_FULL_CHROMA_QUALITY = 90; /* who asks for this much wants no colour bleeding over edges */

const Format formats[SV_FORMAT_COUNT] = {
    {"jpeg", U8, 1 << 1 | 1 << 3, 65500},
    {"png", U8 | U16, 1 << 1 | 1 << 2 | 1 << 3 | 1 << 4, 65536},
    {"webp", U8, 1 << 3 | 1 << 4, 16383},
    {"tiff", U8 | U16 | U32 | F32, ANY_CHANNELS, 65536},
    {"openexr", U8 | U32 | F32, ANY_CHANNELS, 65536},
};

const char *format_name(enum sv_format format)
{
    static const char *const names[] = {
#define X(name, text, media) text,
        SV_FORMAT_LIST(X)
#undef X
    };
    return names[format];
}

const char *type_name(enum sv_pixel_type type)
{
    static const char *const names[] = {"u8", "u16", "u32", "f32"};
    return names[type];
}

TypeDesc oiio_type(enum sv_pixel_type type)
{
    static const TypeDesc::BASETYPE types[] = {TypeDesc::UINT8, TypeDesc::UINT16, TypeDesc::UINT32,
                                               TypeDesc::FLOAT};
    return types[type];
}

enum sv_status check_layer(const sv_encode_layer &layer, const sv_image &first,
                           const sv_encode_options &options, struct sv_error *error)
{
    const sv_image *image = layer.image;
    if (!image || !image->data || image->width < 1 || image->height < 1 || image->channels < 1 ||
        image->channels > 16 || (unsigned)image->type >= SV_PIXEL_TYPE_COUNT)
        return sv_fail(error, SV_EINVAL, "image", "a layer without pixels");
    if (image->width != first.width || image->height != first.height)
        return sv_fail(error, SV_EINVAL, "image", "layers of %d x %d and %d x %d in one file", first.width,
                       first.height, image->width, image->height);
    const Format &format = formats[options.format];
    const char *name = format_name(options.format);
    if (!(format.types >> image->type & 1))
        return sv_fail(error, SV_EUNSUPPORTED, "format", "%s cannot hold %s samples", name,
                       type_name(image->type));
    if (!(format.channels >> image->channels & 1))
        return sv_fail(error, SV_EUNSUPPORTED, "format", "%s cannot hold %d channels", name, image->channels);
    if (image->width > format.max_side || image->height > format.max_side)
        return sv_fail(error, SV_ELIMIT, "format", "%d x %d: %s holds at most %d a side", image->width,
                       image->height, name, format.max_side);
    if (options.format == SV_FORMAT_EXR && !layer.channel_names)
        return sv_fail(error, SV_EINVAL, "image", "exr needs channel names");
    return SV_OK;
}

enum sv_status check(const sv_encode_layer *layers, int count, const sv_encode_options *options,
                     struct sv_error *error)
{
    if (!layers || !options || count < 1 || count > SV_ENCODE_LAYERS_MAX)
        return sv_fail(error, SV_EINVAL, "image", "%d layers, legal are 1..%d", count, SV_ENCODE_LAYERS_MAX);
    if ((unsigned)options->format >= SV_FORMAT_COUNT)
        return sv_fail(error, SV_EINVAL, "format", "no such format: %d", (int)options->format);
    if (options->quality < 1 || options->quality > 100)
        return sv_fail(error, SV_EINVAL, "quality", "%d is outside 1..100", options->quality);
    if (count > 1 && options->format != SV_FORMAT_EXR)
        return sv_fail(error, SV_EUNSUPPORTED, "format", "%s cannot hold %d layers",
                       format_name(options->format), count);
    if (options->geo_tags && options->format != SV_FORMAT_TIFF)
        return sv_fail(error, SV_EUNSUPPORTED, "geo_tags", "%s cannot hold geo tags",
                       format_name(options->format));
    for (int i = 0; i < count; i++) {
        enum sv_status status = check_layer(layers[i], *layers[0].image, *options, error);
        if (status != SV_OK)
            return status;
    }
    return SV_OK;
}

/* Opens, writes all pixels, closes. */
enum sv_status write_all(const Format &format, ImageSpec &spec, TypeDesc type, const void *pixels,
                         void **bytes, size_t *size, struct sv_error *error)
{
    HeapOutput heap;
    auto out = ImageOutput::create(format.plugin);
    if (!out)
        return sv_fail(error, SV_EINTERNAL, "format", "OpenImageIO has no writer for %s", format.plugin);
    if (!out->set_ioproxy(&heap) || !out->open(std::string("memory.") + format.plugin, spec) ||
        !out->write_image(type, pixels) || !out->close())
        return sv_fail(error, SV_EINTERNAL, "image", "%s: %s", format.plugin, out->geterror().c_str());
    *bytes = heap.take(size);
    return SV_OK;
}

/* Where a pixel's alpha is by convention: 2 channels (grey, alpha) or 4 (RGBA), u8 and u16 only. */
int alpha_of(const sv_image &image)
{
    bool color = image.type == SV_PIXEL_U8 || image.type == SV_PIXEL_U16;
    return color && (image.channels == 2 || image.channels == 4) ? image.channels - 1 : -1;
}

enum sv_status encode_plain(const sv_image &image, const sv_encode_options &options, void **bytes,
                            size_t *size, struct sv_error *error)
{
    ImageSpec spec(image.width, image.height, image.channels, oiio_type(image.type));
    spec.alpha_channel = alpha_of(image);
    spec.attribute("oiio:UnassociatedAlpha", 1);
    switch (options.format) { /* settings: table in encode.h */
    case SV_FORMAT_JPEG:
        spec.attribute("Compression", "jpeg:" + std::to_string(options.quality));
        spec.attribute("jpeg:subsampling", options.quality >= JPEG_FULL_CHROMA_QUALITY ? "4:4:4" : "4:2:0");
        break;
    case SV_FORMAT_PNG:
        spec.attribute("png:compressionLevel", 1);
        spec.attribute("png:filter", PNG_FILTER_UP);
        spec.attribute("oiio:ColorSpace",
                       "sRGB");         /* a chunk of 13 bytes; a TIFF would lose its directory over it */
        spec.attribute("DateTime", ""); /* else the present */
        break;
    case SV_FORMAT_TIFF:
        spec.attribute("compression", "zip");
        spec.attribute("tiff:zipquality", 1);
        spec.attribute("DateTime",
                       "0000:00:00 00:00:00"); /* else the present; taken out by sv_geotiff_finish */
        spec.attribute("tiff:write_exif", 0);
        break;
    case SV_FORMAT_WEBP:
    case SV_FORMAT_EXR:
    case SV_FORMAT_COUNT:
        break;
    }
    return write_all(formats[options.format], spec, oiio_type(image.type), image.data, bytes, size, error);
}

/* One channel group's pixels, written every `stride` bytes at `to`. */
void pack_u8(const sv_image &image, unsigned char *to, size_t stride)
{
    const auto *p = (const unsigned char *)image.data;
    int n = image.channels, alpha = alpha_of(image);
    size_t count = (size_t)image.width * (size_t)image.height;
    for (size_t i = 0; i < count; i++, p += n, to += stride) {
        float a = alpha < 0 ? 1.0f : p[alpha] / 255.0f;
        for (int c = 0; c < n; c++) {
            half h(c == alpha ? a : sv_linear_from_srgb8[p[c]] * a);
            memcpy(to + 2 * c, &h, 2);
        }
    }
}

void pack_32(const sv_image &image, unsigned char *to, size_t stride)
{
    size_t bytes = 4 * (size_t)image.channels, count = (size_t)image.width * (size_t)image.height;
    const auto *p = (const unsigned char *)image.data;
    for (size_t i = 0; i < count; i++, p += bytes, to += stride)
        memcpy(to, p, bytes);
}

enum sv_status encode_exr(const sv_encode_layer *layers, int count, void **bytes, size_t *size,
                          struct sv_error *error)
{
    ImageSpec spec(layers[0].image->width, layers[0].image->height, 0, TypeDesc::HALF);
    spec.channelnames.clear();
    size_t stride = 0;
    bool same = true;
    for (int k = 0; k < count; k++) {
        const sv_image &image = *layers[k].image;
        TypeDesc type = image.type == SV_PIXEL_U8 ? TypeDesc(TypeDesc::HALF) : oiio_type(image.type);
        for (int c = 0; c < image.channels; c++) {
            const char *name = layers[k].channel_names[c];
            if (!name || !*name)
                return sv_fail(error, SV_EINVAL, "image", "exr layer %d, channel %d has no name", k, c);
            for (const std::string &other : spec.channelnames)
                if (other == name)
                    return sv_fail(error, SV_EINVAL, "image", "two exr channels named '%s'", name);
            if (!strcmp(name, "A"))
                spec.alpha_channel = spec.nchannels;
            spec.channelnames.push_back(name);
            spec.channelformats.push_back(type);
            same = same && type == spec.channelformats[0];
            spec.nchannels++;
            stride += type.size();
        }
    }
    spec.format = spec.channelformats[0];
    if (same)
        spec.channelformats.clear();
    spec.attribute("compression", same && spec.format == TypeDesc::HALF ? "piz" : "zip:1");
    spec.attribute("DateTime", ""); /* else the present */
    std::vector<unsigned char> pixels(stride * (size_t)spec.width * (size_t)spec.height);
    size_t offset = 0;
    for (int k = 0; k < count; k++) {
        const sv_image &image = *layers[k].image;
        bool narrow = image.type == SV_PIXEL_U8;
        (narrow ? pack_u8 : pack_32)(image, pixels.data() + offset, stride);
        offset += (narrow ? 2 : 4) * (size_t)image.channels;
    }
    return write_all(formats[SV_FORMAT_EXR], spec, same ? spec.format : TypeDesc(TypeDesc::UNKNOWN),
                     pixels.data(), bytes, size, error);
}

} // namespace

void sv_image_init(void)
{
    sv_color_init();
    try {
        OIIO::attribute("threads", 1);
        OIIO::attribute("exr_threads", -1);
        OIIO::attribute("try_all_readers", 0);
        for (const Format &format : formats)
            (void)ImageOutput::create(format.plugin); /* builds the plug-in tables now, not in each child */
    } catch (...) {                                   /* no memory at start: the first call will say so */
    }
}

enum sv_status sv_image_encode(const struct sv_encode_layer *layers, int count,
                               const struct sv_encode_options *options, void **bytes, size_t *size,
                               struct sv_error *error)
{
    enum sv_status status = check(layers, count, options, error);
    if (status != SV_OK)
        return status;
    return sv_image_fenced(
        error, format_name(options->format), [&]() -> enum sv_status {
            void *data = nullptr;
            size_t n = 0;
            enum sv_status s;
            if (options->format == SV_FORMAT_EXR)
                s = encode_exr(layers, count, &data, &n, error);
            else if (options->format == SV_FORMAT_WEBP)
                s = sv_webp_encode(layers[0].image, options->quality, &data, &n, error);
            else
                s = encode_plain(*layers[0].image, *options, &data, &n, error);
            if (s == SV_OK && options->format == SV_FORMAT_TIFF)
                s = sv_geotiff_finish(&data, &n, options->geo_tags, error);
            if (s != SV_OK) {
                free(data);
                return s;
            }
            *bytes = data;
            *size = n;
            return SV_OK;
        });
}
