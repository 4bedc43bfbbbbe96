#include "core/tree/draw_cloud_form.h"

#include "core/tree/billboard.h"
#include "core/tree/density.h"
#include "core/tree/indirect.h"

const struct sv_cloud_form_row sv_cloud_forms[SV_CLOUD_FORM_COUNT] = {
    [SV_CLOUD_FORM_BILLBOARD] = {.name = "billboard",
                                 .kind = SV_BILLBOARD_KIND,
                                 .fragment = "tree_billboard.frag",
                                 .bytes = sv_form_billboard_bytes,
                                 .build = sv_form_billboard_build,
                                 .upload = sv_form_billboard_upload},
    [SV_CLOUD_FORM_DENSITY] = {.name = "density",
                               .kind = SV_DENSITY_PLAIN_KIND,
                               .fragment = "tree_density.frag",
                               .defines = "#define PLANE_AXES 1\n",
                               .bytes = sv_form_density_bytes,
                               .build = sv_form_density_build,
                               .upload = sv_form_density_upload},
    [SV_CLOUD_FORM_DENSITY_PAPER] = {.name = "density_paper",
                                     .kind = SV_DENSITY_PAPER_KIND,
                                     .fragment = "tree_density_paper.frag",
                                     .defines = "#define PLANE_AXES 1\n",
                                     .tested = true,
                                     .bytes = sv_form_density_paper_bytes,
                                     .build = sv_form_density_paper_build,
                                     .upload = sv_form_density_paper_upload},
    [SV_CLOUD_FORM_INDIRECT] = {.name = "indirect",
                                .kind = SV_INDIRECT_KIND,
                                .fragment = "tree_indirect.frag",
                                .bytes = sv_form_indirect_bytes,
                                .build = sv_form_indirect_build,
                                .upload = sv_form_indirect_upload},
};

const char *sv_cloud_form_name(enum sv_cloud_form form)
{
    return (int)form >= 0 && form < SV_CLOUD_FORM_COUNT ? sv_cloud_forms[form].name : NULL;
}
