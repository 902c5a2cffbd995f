// Frame and stage times. Set POCL_AFFINITY=1 on PoCL, or times are bimodal.
#include "bench.hpp"

#include <cstdlib>

int main(int argc, char **argv) {
    // Before the first OpenCL call: PoCL otherwise moves its threads between cores.
    setenv("POCL_AFFINITY", "1", 0);
    benchmark::Initialize(&argc, argv);
    if (benchmark::ReportUnrecognizedArguments(argc, argv))
        return 1;
    const ClspContextInfo info = bench::context().info();
    benchmark::AddCustomContext("opencl_device", info.device_name);
    benchmark::AddCustomContext("opencl_platform", info.platform_name);
    benchmark::RunSpecifiedBenchmarks();
    benchmark::Shutdown();
    return 0;
}
