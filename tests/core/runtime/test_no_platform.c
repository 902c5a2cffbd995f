/* Run with OCL_ICD_VENDORS pointing to an empty folder: no OpenCL platform is installed. Nothing crashes, the list is
 * empty, and the error says how to get a device. */
#include <clspeckle/clspeckle.h>

#include <stdio.h>
#include <string.h>

static int failures;

static void expect(int condition, const char *what) {
    if (!condition) {
        fprintf(stderr, "FAILED: %s\n", what);
        ++failures;
    }
}

int main(void) {
    uint32_t count = 99;
    uint64_t length = 0;
    char text[4096] = "";
    ClspContext context = NULL;
    ClspErrorInfo error;

    expect(clspDeviceList(0, NULL, &count) == CLSP_SUCCESS, "an empty device list is no error");
    expect(count == 0, "there is no device");
    expect(clspDeviceExplain(NULL, sizeof(text), text, &length) == CLSP_SUCCESS, "the explanation is no error");
    expect(length == strlen(text) + 1, "the explanation has its length");
    expect(strstr(text, "apt install pocl-opencl-icd") != NULL, "the explanation says how to install PoCL");
    expect(strstr(text, "OCL_ICD_VENDORS") != NULL, "the explanation says where OpenCL looks for drivers");

    expect(clspContextCreate(NULL, &context) == CLSP_ERROR_NO_DEVICE, "creating a context gives CLSP_ERROR_NO_DEVICE");
    expect(context == NULL, "no context is given");
    error.struct_size = sizeof(error);
    expect(clspGetLastError(&error) == CLSP_SUCCESS, "the error has details");
    expect(error.status == CLSP_ERROR_NO_DEVICE, "the details have the status");
    expect(strcmp(error.function, "clspContextCreate") == 0, "the details name the function");
    expect(strstr(error.message, "No OpenCL device was found") != NULL, "the message says what is wrong");
    expect(strstr(error.message, "apt install pocl-opencl-icd") != NULL, "the message says what to do");
    if (failures == 0)
        printf("%s", error.message);
    return failures == 0 ? 0 : 1;
}
