// For an engine that draws with OpenGL: the ideal image is a texture, and so are the codes. Where the OpenCL device
// shares with GL, neither leaves it; elsewhere they go through host memory. The scene and the seeds are those of
// ../c/minimal.c, and so are the files.
//
// EGL without a window makes the GL context. With SDL2 or GLFW it is theirs: their window's current context, and
// CL_GLX_DISPLAY_KHR or CL_EGL_DISPLAY_KHR with the display that it is on.
//
//     gl_texture [prefix]        writes <prefix>_0.pgm to <prefix>_9.pgm, by default gl_0.pgm to gl_9.pgm
#include <clspeckle/clspeckle.hpp>

#include <CL/cl_gl.h>
#include <EGL/egl.h>
#include <EGL/eglext.h>
#include <GL/gl.h>
#include <GL/glext.h>

#include <cmath>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <fstream>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

namespace {

constexpr std::uint32_t width = 320, height = 240, frames = 10;

// A GL context without a window, current on this thread.
struct Gl {
    EGLDisplay display = eglGetPlatformDisplay(EGL_PLATFORM_SURFACELESS_MESA, nullptr, nullptr);
    EGLContext context = EGL_NO_CONTEXT;

    Gl() {
        if (display == EGL_NO_DISPLAY)
            display = eglGetDisplay(EGL_DEFAULT_DISPLAY);
        const EGLint wanted[] = {EGL_SURFACE_TYPE, 0, EGL_RENDERABLE_TYPE, EGL_OPENGL_BIT, EGL_NONE};
        EGLConfig config = nullptr;
        EGLint count = 0;
        if (eglInitialize(display, nullptr, nullptr) && eglBindAPI(EGL_OPENGL_API) &&
            eglChooseConfig(display, wanted, &config, 1, &count) && count == 1)
            context = eglCreateContext(display, config, EGL_NO_CONTEXT, nullptr);
        if (context == EGL_NO_CONTEXT || !eglMakeCurrent(display, EGL_NO_SURFACE, EGL_NO_SURFACE, context))
            throw std::runtime_error(
                "no GL context without a window can be made here; install libegl-mesa0 and libgl1-mesa-dri");
    }
    Gl(const Gl &) = delete;
    Gl &operator=(const Gl &) = delete;
    ~Gl() {
        eglMakeCurrent(display, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
        eglDestroyContext(display, context);
        eglTerminate(display);
    }
};

GLuint make_texture(GLint internal_format, GLenum format, GLenum type, const void *texels) {
    GLuint texture = 0;
    glGenTextures(1, &texture);
    glBindTexture(GL_TEXTURE_2D, texture);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_NEAREST); // complete without a mipmap
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_NEAREST);
    glTexImage2D(GL_TEXTURE_2D, 0, internal_format, width, height, 0, format, type, texels);
    if (const GLenum error = glGetError(); error != GL_NO_ERROR)
        throw std::runtime_error("GL error " + std::to_string(error) + " while a texture was made");
    return texture;
}

// Dots of 1.5 pixels standard deviation, 16 pixels apart, every other row shifted by half of that.
std::vector<float> draw_dots() {
    std::vector<float> image(width * height);
    for (std::uint32_t y = 0; y < height; ++y) {
        for (std::uint32_t x = 0; x < width; ++x) {
            const double dx = static_cast<double>((x + (y / 16 % 2 ? 8 : 0)) % 16) - 7.5,
                         dy = static_cast<double>(y % 16) - 7.5;
            image[y * width + x] = static_cast<float>(std::exp(-(dx * dx + dy * dy) / (2.0 * 1.5 * 1.5)));
        }
    }
    return image;
}

void write_pgm(const std::string &path, const std::vector<std::uint16_t> &codes) {
    const std::string temporary = path + ".part";
    std::ofstream file(temporary, std::ios::binary);
    file << "P5\n" << width << ' ' << height << "\n1023\n";
    for (const std::uint16_t code : codes)
        file.put(static_cast<char>(code >> 8)).put(static_cast<char>(code & 0xff));
    file.close();
    if (!file) {
        std::remove(temporary.c_str());
        throw std::runtime_error("cannot write " + path);
    }
    std::filesystem::rename(temporary, path);
}

// A context on a device that shares with the GL context; nothing, and why, if there is none.
std::optional<clspeckle::Context> shared_context(const Gl &gl) {
    for (const ClspDeviceInfo &device : clspeckle::devices()) {
        if (!device.usable)
            continue;
        const cl_context_properties properties[] = {CL_GL_CONTEXT_KHR,
                                                    reinterpret_cast<cl_context_properties>(gl.context),
                                                    CL_EGL_DISPLAY_KHR,
                                                    reinterpret_cast<cl_context_properties>(gl.display),
                                                    CL_CONTEXT_PLATFORM,
                                                    reinterpret_cast<cl_context_properties>(device.platform_id),
                                                    0};
        cl_int code = CL_SUCCESS;
        const cl_context made = clCreateContext(properties, 1, &device.device_id, nullptr, nullptr, &code);
        if (code != CL_SUCCESS) {
            std::printf("%s makes no context for this GL context (OpenCL code %d)\n", device.name, code);
            continue;
        }
        const auto context = clspeckle::Context::from_host(made, device.device_id);
        clReleaseContext(made); // it has a reference of its own
        const ClspInteropInfo interop = context.interop_info();
        if (interop.gl_textures)
            return context;
        std::printf("%s\n", interop.gl_textures_reason);
    }
    return std::nullopt;
}

void run(const std::string &prefix) {
    const Gl gl;
    const GLuint picture = make_texture(GL_R32F, GL_RED, GL_FLOAT, draw_dots().data()); // what the engine draws into
    const GLuint codes = make_texture(GL_R16UI, GL_RED_INTEGER, GL_UNSIGNED_SHORT, nullptr);

    const std::optional<clspeckle::Context> shared = shared_context(gl);
    const clspeckle::Context context = shared ? *shared : clspeckle::Context();
    std::printf("the frames %s\n", shared ? "stay on the device" : "go through host memory");
    const clspeckle::Queue queue(context);
    auto phase_desc = clspeckle::make<ClspPhaseDesc>();
    auto aperture_desc = clspeckle::make<ClspApertureDesc>();
    auto sensor_desc = clspeckle::make<ClspSensorDesc>();
    phase_desc.width = aperture_desc.width = sensor_desc.width = width;
    phase_desc.height = aperture_desc.height = sensor_desc.height = height;
    phase_desc.seed = sensor_desc.seed = 2024;
    aperture_desc.degree_of_polarization = 0.5;
    aperture_desc.normalization = CLSP_NORMALIZATION_UNIT_MEAN;
    sensor_desc.bits = 10;
    const clspeckle::Pipeline pipeline(context, clspeckle::Phase(context, phase_desc),
                                       clspeckle::Aperture(context, aperture_desc),
                                       clspeckle::Sensor(context, sensor_desc));
    const clspeckle::Buffer irradiance(context, width * height * sizeof(float));
    const clspeckle::Buffer output(context, width * height * sizeof(std::uint16_t));
    auto frame = clspeckle::make<ClspFrame>();
    frame.irradiance = irradiance.image(width, height, CLSP_FORMAT_FLOAT32);
    frame.output = output.image(width, height, CLSP_FORMAT_UINT16);
    clspeckle::ClImage source, target;
    if (shared) {
        source = clspeckle::ClImage::from_gl(context, CL_MEM_READ_ONLY, GL_TEXTURE_2D, 0, picture);
        target = clspeckle::ClImage::from_gl(context, CL_MEM_WRITE_ONLY, GL_TEXTURE_2D, 0, codes);
    }

    std::vector<float> light(width * height);
    std::vector<std::uint16_t> result(width * height);
    for (std::uint32_t i = 0; i < frames; ++i) {
        frame.frame_index = i;
        // The engine draws the next picture here.
        if (shared) {
            glFinish(); // what GL has drawn must be there before OpenCL takes it
            clspeckle::Event released;
            clspeckle::shared::enqueue_acquire(context, queue, CLSP_SHARED_GL, {source, target});
            source.enqueue_import(context, queue, 0, frame.irradiance);
            pipeline.enqueue_frame(queue, frame);
            target.enqueue_export(context, queue, frame.output);
            clspeckle::shared::enqueue_release(context, queue, CLSP_SHARED_GL, {source, target}, {}, &released);
            released.wait(); // and the other way round
        } else {
            glBindTexture(GL_TEXTURE_2D, picture);
            glGetTexImage(GL_TEXTURE_2D, 0, GL_RED, GL_FLOAT, light.data());
            irradiance.write(queue, light);
            pipeline.enqueue_frame(queue, frame);
            output.read(queue, result);
            glBindTexture(GL_TEXTURE_2D, codes);
            glTexSubImage2D(GL_TEXTURE_2D, 0, 0, 0, width, height, GL_RED_INTEGER, GL_UNSIGNED_SHORT, result.data());
        }
        // The engine shows the texture of codes; here it goes into a file.
        glBindTexture(GL_TEXTURE_2D, codes);
        glGetTexImage(GL_TEXTURE_2D, 0, GL_RED_INTEGER, GL_UNSIGNED_SHORT, result.data());
        write_pgm(prefix + '_' + std::to_string(i) + ".pgm", result);
    }
    pipeline.check(queue);
    source.reset(); // before the textures that they are made of
    target.reset();
    const GLuint textures[] = {picture, codes};
    glDeleteTextures(2, textures);
}

} // namespace

int main(int argc, char **argv) {
    const std::string prefix = argc > 1 ? argv[1] : "gl";
    try {
        run(prefix);
    } catch (const clspeckle::Error &error) {
        std::fprintf(stderr, "%s\n%s", error.what(), error.build_log().c_str());
        return 1;
    } catch (const std::exception &error) {
        std::fprintf(stderr, "%s\n", error.what());
        return 1;
    }
    std::printf("wrote %s_0.pgm to %s_%u.pgm\n", prefix.c_str(), prefix.c_str(), frames - 1);
}
