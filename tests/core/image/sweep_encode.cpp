/* sweep_encode.cpp - time and bytes of every setting that the encoders could use: where the table in
 * core/image/encode.h comes from. Not a test. `sweep_encode [SIDE] [PICTURE]`: a made-up landscape, or a
 * picture file stretched to SIDE. */
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>
#include <vector>

#include <unistd.h>

#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/half.h>
#include <OpenImageIO/imageio.h>
#include <webp/encode.h>

extern "C" {
#include "core/base/color.h"
#include "core/image/encode.h"
#include "tests/core/image/picture.h"
}

using namespace OIIO;

namespace
{

using Attributes = std::vector<std::pair<std::string, std::string>>;

double now_ms()
{
    return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now().time_since_epoch())
        .count();
}

template <class F> void report(const std::string &name, F run)
{
    double best = 1e30;
    size_t bytes = 0;
    for (int i = 0; i < 5; i++) {
        double t = now_ms();
        bytes = run();
        t = now_ms() - t;
        best = t < best ? t : best;
    }
    printf("%-44s %8.2f ms %9zu bytes\n", name.c_str(), best, bytes);
}

void oiio(const char *format, const ImageSpec &base, const void *pixels, const Attributes &attributes)
{
    std::string name = format;
    ImageSpec spec = base;
    for (const auto &a : attributes) {
        char *end;
        long v = strtol(a.second.c_str(), &end, 10);
        if (*end)
            spec.attribute(a.first, a.second);
        else
            spec.attribute(a.first, (int)v);
        name += " " + a.first + "=" + a.second;
    }
    report(name, [&]() -> size_t {
        Filesystem::IOVecOutput out;
        auto writer = ImageOutput::create(format);
        writer->set_ioproxy(&out);
        if (!writer->open(std::string("m.") + format, spec) || !writer->write_image(spec.format, pixels) ||
            !writer->close())
            printf("%s\n", writer->geterror().c_str());
        return out.buffer().size();
    });
}

void webp(const sv_image &rgb, const char *name, int method, bool lossless)
{
    report(std::string("libwebp ") + name, [&]() -> size_t {
        WebPConfig config;
        WebPPicture picture;
        WebPConfigInit(&config);
        WebPPictureInit(&picture);
        config.quality = lossless ? 20 : 85;
        config.method = method;
        config.lossless = lossless;
        WebPMemoryWriter writer;
        WebPMemoryWriterInit(&writer);
        picture.writer = WebPMemoryWrite;
        picture.custom_ptr = &writer;
        picture.width = rgb.width;
        picture.height = rgb.height;
        picture.use_argb = lossless;
        WebPPictureImportRGB(&picture, (const uint8_t *)rgb.data, rgb.width * 3);
        WebPEncode(&config, &picture);
        size_t n = writer.size;
        WebPPictureFree(&picture);
        WebPMemoryWriterClear(&writer);
        return n;
    });
}

void stretch(const char *path, sv_image &rgba)
{
    sv_image photo;
    sv_error error;
    if (sv_image_decode_file(path, SV_DECODE_SIDE_MAX, &photo, nullptr, &error) != SV_OK) {
        fprintf(stderr, "%s: %s\n", path, error.message);
        _exit(1);
    }
    for (int y = 0; y < rgba.height; y++)
        for (int x = 0; x < rgba.width; x++)
            memcpy((char *)rgba.data + 4 * (y * rgba.width + x),
                   (char *)photo.data +
                       4 * ((y * photo.height / rgba.height) * photo.width + x * photo.width / rgba.width),
                   3);
}

} // namespace

int main(int argc, char **argv)
{
    int side = argc > 1 ? atoi(argv[1]) : 512;
    sv_image_init();
    sv_image rgba, depth, id;
    picture_make(side, side, &rgba, &depth, &id);
    if (argc > 2)
        stretch(argv[2], rgba);
    size_t count = (size_t)side * (size_t)side;
    std::vector<unsigned char> data(count * 3);
    std::vector<half> halves(count * 3);
    for (size_t i = 0; i < count; i++)
        for (size_t k = 0; k < 3; k++) {
            data[3 * i + k] = ((unsigned char *)rgba.data)[4 * i + k];
            halves[3 * i + k] = sv_linear_from_srgb8[data[3 * i + k]];
        }
    sv_image rgb = {side, side, 3, SV_PIXEL_U8, data.data()};
    ImageSpec u8(side, side, 3, TypeDesc::UINT8), f16(side, side, 3, TypeDesc::HALF),
        f32(side, side, 1, TypeDesc::FLOAT);
    ImageSpec u32(side, side, 1, TypeDesc::UINT32);

    for (const char *s : {"4:4:4", "4:2:2", "4:2:0"})
        for (const char *p : {"0", "1"})
            oiio("jpeg", u8, data.data(),
                 {{"Compression", "jpeg:85"}, {"jpeg:subsampling", s}, {"jpeg:progressive", p}});
    oiio("png", u8, data.data(), {});
    for (const char *level : {"1", "2", "3", "6"})
        for (const char *filter : {"0", "8", "16", "32", "64", "128", "248"})
            oiio("png", u8, data.data(), {{"png:compressionLevel", level}, {"png:filter", filter}});
    oiio("webp", u8, data.data(), {});
    oiio("webp", u8, data.data(), {{"Compression", "webp:85"}});
    oiio("webp", u8, data.data(), {{"Compression", "webp:85"}, {"webp:method", "0"}});
    for (int m = 0; m <= 6; m++)
        webp(rgb, ("method=" + std::to_string(m) + " q=85").c_str(), m, false);
    webp(rgb, "lossless method=0 effort 20", 0, true);
    for (const ImageSpec *s : {&u8, &f32, &u32}) {
        const void *p = s == &u8 ? (void *)data.data() : s == &f32 ? depth.data : id.data;
        printf("-- %s x %d\n", s->format.c_str(), s->nchannels);
        oiio("tiff", *s, p, {});
        for (const char *c : {"none", "lzw", "packbits", "zip:1"})
            oiio("tiff", *s, p, {{"compression", c}});
        for (const char *q : {"1", "2", "4", "6"})
            oiio("tiff", *s, p, {{"compression", "zip"}, {"tiff:zipquality", q}});
        oiio("tiff", *s, p, {{"compression", "zip"}, {"tiff:zipquality", "1"}, {"tiff:RowsPerStrip", "128"}});
    }
    for (const ImageSpec *s : {&f16, &f32, &u32}) {
        const void *p = s == &f16 ? (void *)halves.data() : s == &f32 ? depth.data : id.data;
        printf("-- %s x %d\n", s->format.c_str(), s->nchannels);
        for (const char *c :
             {"none", "rle", "zips:1", "zips:4", "zip:1", "zip:2", "zip:4", "piz", "pxr24", "b44", "dwaa"})
            oiio("openexr", *s, p, {{"compression", c}});
    }
    fflush(stdout);
    _exit(0);
}
