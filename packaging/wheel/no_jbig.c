/*
 * What libtiff calls of libjbig, for a wheel that does without it: Debian's libtiff is linked with libjbig, whose
 * licence is the GPL, and a wheel that holds it can be passed on under the GPL only. Images that are compressed as JBIG
 * (group 3 fax machines' successor, one bit a pixel) are refused; no camera writes them.
 */
#include <stddef.h>

enum { NOT_THERE = 1 }; /* anything but 0, which means success */

void jbg_dec_init(void *state) { (void)state; }
void jbg_dec_free(void *state) { (void)state; }
void jbg_enc_free(void *state) { (void)state; }
void jbg_enc_out(void *state) { (void)state; }

int jbg_dec_in(void *state, unsigned char *data, size_t length, size_t *used) {
    (void)state, (void)data, (void)length;
    if (used)
        *used = 0;
    return NOT_THERE;
}

int jbg_newlen(unsigned char *data, size_t length) {
    (void)data, (void)length;
    return NOT_THERE;
}

unsigned long jbg_dec_getsize(const void *state) {
    (void)state;
    return 0;
}

unsigned char *jbg_dec_getimage(const void *state, int plane) {
    (void)state, (void)plane;
    return NULL;
}

const char *jbg_strerror(int number) {
    (void)number;
    return "this build reads no JBIG";
}

void jbg_enc_init(void *state, unsigned long width, unsigned long height, int planes, unsigned char **data,
                  void (*out)(unsigned char *, size_t, void *), void *file) {
    (void)state, (void)width, (void)height, (void)planes, (void)data, (void)out, (void)file;
}
