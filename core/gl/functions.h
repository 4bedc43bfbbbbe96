/* functions.h - the GL entry points, loaded once by the context: gl.Clear(...) instead of glClear(...).
 *
 * One X-macro list names every function that the project calls; a missing one fails the context's creation by
 * name. Only core/gl and the files that draw include this header (it includes <GL/glcorearb.h>). Loaded
 * before any fork; read only afterwards. */
#ifndef SV_GL_FUNCTIONS_H
#define SV_GL_FUNCTIONS_H

#include <GL/glcorearb.h>

#define SV_GL_FUNCTION_LIST(X)                                                                           \
    X(PFNGLACTIVETEXTUREPROC, ActiveTexture)                                                             \
    X(PFNGLATTACHSHADERPROC, AttachShader)                                                               \
    X(PFNGLBINDBUFFERPROC, BindBuffer)                                                                   \
    X(PFNGLBINDBUFFERBASEPROC, BindBufferBase)                                                           \
    X(PFNGLBINDBUFFERRANGEPROC, BindBufferRange)                                                         \
    X(PFNGLBINDFRAMEBUFFERPROC, BindFramebuffer)                                                         \
    X(PFNGLBINDRENDERBUFFERPROC, BindRenderbuffer)                                                       \
    X(PFNGLBINDSAMPLERPROC, BindSampler)                                                                 \
    X(PFNGLBINDTEXTUREPROC, BindTexture)                                                                 \
    X(PFNGLBINDVERTEXARRAYPROC, BindVertexArray)                                                         \
    X(PFNGLBLENDEQUATIONPROC, BlendEquation)                                                             \
    X(PFNGLBLENDFUNCPROC, BlendFunc)                                                                     \
    X(PFNGLBLENDFUNCSEPARATEPROC, BlendFuncSeparate)                                                     \
    X(PFNGLBLENDFUNCIPROC, BlendFunci)                                                                   \
    X(PFNGLBLITFRAMEBUFFERPROC, BlitFramebuffer)                                                         \
    X(PFNGLBUFFERDATAPROC, BufferData)                                                                   \
    X(PFNGLBUFFERSTORAGEPROC, BufferStorage)                                                             \
    X(PFNGLBUFFERSUBDATAPROC, BufferSubData)                                                             \
    X(PFNGLCHECKFRAMEBUFFERSTATUSPROC, CheckFramebufferStatus)                                           \
    X(PFNGLCLEARPROC, Clear)                                                                             \
    X(PFNGLCLEARBUFFERFVPROC, ClearBufferfv)                                                             \
    X(PFNGLCLEARBUFFERUIVPROC, ClearBufferuiv)                                                           \
    X(PFNGLCLEARCOLORPROC, ClearColor)                                                                   \
    X(PFNGLCLEARDEPTHFPROC, ClearDepthf)                                                                 \
    X(PFNGLCLIPCONTROLPROC, ClipControl)                                                                 \
    X(PFNGLCOLORMASKPROC, ColorMask)                                                                     \
    X(PFNGLCOLORMASKIPROC, ColorMaski)                                                                   \
    X(PFNGLCOMPILESHADERPROC, CompileShader)                                                             \
    X(PFNGLCOMPRESSEDTEXIMAGE2DPROC, CompressedTexImage2D)                                               \
    X(PFNGLCOMPRESSEDTEXSUBIMAGE2DPROC, CompressedTexSubImage2D)                                         \
    X(PFNGLCOMPRESSEDTEXSUBIMAGE3DPROC, CompressedTexSubImage3D)                                         \
    X(PFNGLCREATEPROGRAMPROC, CreateProgram)                                                             \
    X(PFNGLCREATESHADERPROC, CreateShader)                                                               \
    X(PFNGLCULLFACEPROC, CullFace)                                                                       \
    X(PFNGLDELETEBUFFERSPROC, DeleteBuffers)                                                             \
    X(PFNGLDELETEFRAMEBUFFERSPROC, DeleteFramebuffers)                                                   \
    X(PFNGLDELETEPROGRAMPROC, DeleteProgram)                                                             \
    X(PFNGLDELETERENDERBUFFERSPROC, DeleteRenderbuffers)                                                 \
    X(PFNGLDELETESAMPLERSPROC, DeleteSamplers)                                                           \
    X(PFNGLDELETESHADERPROC, DeleteShader)                                                               \
    X(PFNGLDELETETEXTURESPROC, DeleteTextures)                                                           \
    X(PFNGLDELETEVERTEXARRAYSPROC, DeleteVertexArrays)                                                   \
    X(PFNGLDEPTHFUNCPROC, DepthFunc)                                                                     \
    X(PFNGLDEPTHMASKPROC, DepthMask)                                                                     \
    X(PFNGLDETACHSHADERPROC, DetachShader)                                                               \
    X(PFNGLDISABLEPROC, Disable)                                                                         \
    X(PFNGLDISABLEIPROC, Disablei)                                                                       \
    X(PFNGLDISABLEVERTEXATTRIBARRAYPROC, DisableVertexAttribArray)                                       \
    X(PFNGLDRAWARRAYSPROC, DrawArrays)                                                                   \
    X(PFNGLDRAWARRAYSINSTANCEDPROC, DrawArraysInstanced)                                                 \
    X(PFNGLDRAWARRAYSINSTANCEDBASEINSTANCEPROC, DrawArraysInstancedBaseInstance)                         \
    X(PFNGLDRAWBUFFERPROC, DrawBuffer)                                                                   \
    X(PFNGLDRAWBUFFERSPROC, DrawBuffers)                                                                 \
    X(PFNGLDRAWELEMENTSPROC, DrawElements)                                                               \
    X(PFNGLDRAWELEMENTSINSTANCEDPROC, DrawElementsInstanced)                                             \
    X(PFNGLDRAWELEMENTSINSTANCEDBASEINSTANCEPROC, DrawElementsInstancedBaseInstance)                     \
    X(PFNGLDRAWELEMENTSINSTANCEDBASEVERTEXPROC, DrawElementsInstancedBaseVertex)                         \
    X(PFNGLDRAWELEMENTSINSTANCEDBASEVERTEXBASEINSTANCEPROC, DrawElementsInstancedBaseVertexBaseInstance) \
    X(PFNGLDRAWRANGEELEMENTSPROC, DrawRangeElements)                                                     \
    X(PFNGLENABLEPROC, Enable)                                                                           \
    X(PFNGLENABLEIPROC, Enablei)                                                                         \
    X(PFNGLENABLEVERTEXATTRIBARRAYPROC, EnableVertexAttribArray)                                         \
    X(PFNGLFINISHPROC, Finish)                                                                           \
    X(PFNGLFLUSHPROC, Flush)                                                                             \
    X(PFNGLFRAMEBUFFERRENDERBUFFERPROC, FramebufferRenderbuffer)                                         \
    X(PFNGLFRAMEBUFFERTEXTURE2DPROC, FramebufferTexture2D)                                               \
    X(PFNGLFRAMEBUFFERTEXTURELAYERPROC, FramebufferTextureLayer)                                         \
    X(PFNGLFRONTFACEPROC, FrontFace)                                                                     \
    X(PFNGLGENBUFFERSPROC, GenBuffers)                                                                   \
    X(PFNGLGENERATEMIPMAPPROC, GenerateMipmap)                                                           \
    X(PFNGLGENFRAMEBUFFERSPROC, GenFramebuffers)                                                         \
    X(PFNGLGENRENDERBUFFERSPROC, GenRenderbuffers)                                                       \
    X(PFNGLGENSAMPLERSPROC, GenSamplers)                                                                 \
    X(PFNGLGENTEXTURESPROC, GenTextures)                                                                 \
    X(PFNGLGENVERTEXARRAYSPROC, GenVertexArrays)                                                         \
    X(PFNGLGETERRORPROC, GetError)                                                                       \
    X(PFNGLGETFLOATVPROC, GetFloatv)                                                                     \
    X(PFNGLGETINTEGERVPROC, GetIntegerv)                                                                 \
    X(PFNGLGETPROGRAMINFOLOGPROC, GetProgramInfoLog)                                                     \
    X(PFNGLGETPROGRAMIVPROC, GetProgramiv)                                                               \
    X(PFNGLGETSHADERINFOLOGPROC, GetShaderInfoLog)                                                       \
    X(PFNGLGETSHADERIVPROC, GetShaderiv)                                                                 \
    X(PFNGLGETSTRINGPROC, GetString)                                                                     \
    X(PFNGLGETSTRINGIPROC, GetStringi)                                                                   \
    X(PFNGLGETTEXIMAGEPROC, GetTexImage)                                                                 \
    X(PFNGLGETTEXLEVELPARAMETERIVPROC, GetTexLevelParameteriv)                                           \
    X(PFNGLGETUNIFORMBLOCKINDEXPROC, GetUniformBlockIndex)                                               \
    X(PFNGLGETUNIFORMLOCATIONPROC, GetUniformLocation)                                                   \
    X(PFNGLLINKPROGRAMPROC, LinkProgram)                                                                 \
    X(PFNGLMAPBUFFERRANGEPROC, MapBufferRange)                                                           \
    X(PFNGLMULTIDRAWELEMENTSBASEVERTEXPROC, MultiDrawElementsBaseVertex)                                 \
    X(PFNGLMULTIDRAWELEMENTSINDIRECTPROC, MultiDrawElementsIndirect)                                     \
    X(PFNGLPIXELSTOREIPROC, PixelStorei)                                                                 \
    X(PFNGLPOLYGONOFFSETPROC, PolygonOffset)                                                             \
    X(PFNGLREADBUFFERPROC, ReadBuffer)                                                                   \
    X(PFNGLREADPIXELSPROC, ReadPixels)                                                                   \
    X(PFNGLRENDERBUFFERSTORAGEPROC, RenderbufferStorage)                                                 \
    X(PFNGLSAMPLERPARAMETERFPROC, SamplerParameterf)                                                     \
    X(PFNGLSAMPLERPARAMETERIPROC, SamplerParameteri)                                                     \
    X(PFNGLSCISSORPROC, Scissor)                                                                         \
    X(PFNGLSHADERSOURCEPROC, ShaderSource)                                                               \
    X(PFNGLTEXBUFFERPROC, TexBuffer)                                                                     \
    X(PFNGLTEXIMAGE2DPROC, TexImage2D)                                                                   \
    X(PFNGLTEXIMAGE3DPROC, TexImage3D)                                                                   \
    X(PFNGLTEXPARAMETERFPROC, TexParameterf)                                                             \
    X(PFNGLTEXPARAMETERFVPROC, TexParameterfv)                                                           \
    X(PFNGLTEXPARAMETERIPROC, TexParameteri)                                                             \
    X(PFNGLTEXSTORAGE2DPROC, TexStorage2D)                                                               \
    X(PFNGLTEXSTORAGE3DPROC, TexStorage3D)                                                               \
    X(PFNGLTEXSUBIMAGE2DPROC, TexSubImage2D)                                                             \
    X(PFNGLTEXSUBIMAGE3DPROC, TexSubImage3D)                                                             \
    X(PFNGLUNIFORM1FPROC, Uniform1f)                                                                     \
    X(PFNGLUNIFORM1FVPROC, Uniform1fv)                                                                   \
    X(PFNGLUNIFORM1IPROC, Uniform1i)                                                                     \
    X(PFNGLUNIFORM1UIPROC, Uniform1ui)                                                                   \
    X(PFNGLUNIFORM2FPROC, Uniform2f)                                                                     \
    X(PFNGLUNIFORM2FVPROC, Uniform2fv)                                                                   \
    X(PFNGLUNIFORM3FPROC, Uniform3f)                                                                     \
    X(PFNGLUNIFORM3FVPROC, Uniform3fv)                                                                   \
    X(PFNGLUNIFORM4FPROC, Uniform4f)                                                                     \
    X(PFNGLUNIFORM4FVPROC, Uniform4fv)                                                                   \
    X(PFNGLUNIFORMBLOCKBINDINGPROC, UniformBlockBinding)                                                 \
    X(PFNGLUNIFORMMATRIX3FVPROC, UniformMatrix3fv)                                                       \
    X(PFNGLUNIFORMMATRIX4FVPROC, UniformMatrix4fv)                                                       \
    X(PFNGLUNMAPBUFFERPROC, UnmapBuffer)                                                                 \
    X(PFNGLUSEPROGRAMPROC, UseProgram)                                                                   \
    X(PFNGLVERTEXATTRIBDIVISORPROC, VertexAttribDivisor)                                                 \
    X(PFNGLVERTEXATTRIBIPOINTERPROC, VertexAttribIPointer)                                               \
    X(PFNGLVERTEXATTRIBPOINTERPROC, VertexAttribPointer)                                                 \
    X(PFNGLVERTEXATTRIB4FPROC, VertexAttrib4f)                                                           \
    X(PFNGLVIEWPORTPROC, Viewport)

struct sv_gl_functions {
#define X(type, name) type name;
    SV_GL_FUNCTION_LIST(X)
#undef X
};

extern struct sv_gl_functions gl;

#endif
