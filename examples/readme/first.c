#include <clspeckle/clspeckle.h>
#include <stdio.h>

int main(void) {
    static float ideal[480 * 640]; /* what a renderer made: here a flat, lit wall */
    static uint16_t codes[480 * 640];
    for (int i = 0; i < 480 * 640; ++i)
        ideal[i] = 1.0f;
    ClspErrorInfo error = {.struct_size = sizeof error};
    if (clspSimulate(NULL, 640, 480, ideal, NULL, NULL, 7, 0, codes) && !clspGetLastError(&error))
        return fprintf(stderr, "%s\n", error.message), 1;
    printf("first codes: %u %u %u\n", codes[0], codes[1], codes[2]);
    return 0;
}
