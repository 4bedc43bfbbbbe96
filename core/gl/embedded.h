/* embedded.h - the table of embedded GLSL files that embed.cmake writes; ends with a row of NULL. Private to
 * core/gl. */
#ifndef SV_GL_EMBEDDED_H
#define SV_GL_EMBEDDED_H

struct sv_gl_embedded {
    const char *name, *text;
};

extern const struct sv_gl_embedded sv_gl_embedded[];

#endif
