/* The general elimination: see armkin/inverse/elimination/pencil.py for the symbols.
   slot: which link carries the pose; hidden, dialytic: which of the middle joints; wide: the third one is dialytic, too;
   order: the joints by part. */
typedef struct {
    double psi;
    int slot, backward, hidden, dialytic, wide, rows, r, w, size;
    unsigned char order[6], slides[6];
    const double *links, *first, *second, *N, *recover, *columns, *mix, *K_re, *K_im, *W;
} arm_pencil;

