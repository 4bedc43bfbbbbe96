/* bands.h - one picture that several processes draw, of each a band of its rows.
 *
 * Bands are parts of the whole, byte for byte, as long as all are drawn in one way. With relief=auto what that is
 * is decided by what was measured (core/cell/admit.h), which changes from moment to moment: so the first that
 * decides tells the others. How, is for whoever starts the processes. No drawing here. */
#ifndef SV_VIEW_BANDS_H
#define SV_VIEW_BANDS_H

/* What those who draw one picture share. */
struct sv_bands {
    void *context;
    /* The level that was agreed on; when none is yet, that becomes `level` unless it is negative. Negative: none is. */
    int (*agree)(void *context, int level);
};

#endif
