#include "measure/emva1288.hpp"

#include "measure/emva_measurement.hpp"

namespace clsp {

std::vector<NamedEmvaValue> named_values(const Emva1288 &e) {
    return {{"system_gain", "DN/e", "system gain K", &e.gain},
            {"dark_level", "DN", "dark level", &e.dark_level},
            {"dark_noise", "DN", "temporal dark noise", &e.dark_noise},
            {"dark_noise_e", "e", "temporal dark noise, without quantization", &e.dark_noise_e},
            {"dsnu", "DN", "DSNU", &e.dsnu.total},
            {"dsnu_pixel", "DN", "DSNU of pixels", &e.dsnu.pixel},
            {"dsnu_row", "DN", "DSNU of rows", &e.dsnu.row},
            {"dsnu_column", "DN", "DSNU of columns", &e.dsnu.column},
            {"dsnu_e", "e", "DSNU", &e.dsnu_e.total},
            {"dsnu_pixel_e", "e", "DSNU of pixels", &e.dsnu_e.pixel},
            {"dsnu_row_e", "e", "DSNU of rows", &e.dsnu_e.row},
            {"dsnu_column_e", "e", "DSNU of columns", &e.dsnu_e.column},
            {"prnu", "%", "PRNU", &e.prnu.total},
            {"prnu_pixel", "%", "PRNU of pixels", &e.prnu.pixel},
            {"prnu_row", "%", "PRNU of rows", &e.prnu.row},
            {"prnu_column", "%", "PRNU of columns", &e.prnu.column},
            {"linearity_error_min", "%", "least linearity error", &e.linearity_min},
            {"linearity_error_max", "%", "largest linearity error", &e.linearity_max},
            {"saturation", "DN", "saturation, above dark", &e.saturation},
            {"saturation_capacity", "e", "saturation capacity", &e.saturation_e},
            {"sensitivity_threshold", "e", "absolute sensitivity threshold", &e.sensitivity_threshold},
            {"snr_max", "dB", "largest signal-to-noise ratio", &e.snr_max},
            {"dynamic_range", "dB", "dynamic range", &e.dynamic_range},
            {"dark_current", "DN/ms", "dark current", &e.dark_current},
            {"dark_current_e", "e/s", "dark current", &e.dark_current_e}};
}

const char *method_name(EmvaGainMethod method) {
    switch (method) {
    case EmvaGainMethod::kFlats:
        return "flats";
    case EmvaGainMethod::kOneFlat:
        return "one_flat";
    case EmvaGainMethod::kFlatsWithoutDark:
        return "flats_without_dark";
    case EmvaGainMethod::kLaserAtRest:
        return "laser_at_rest";
    case EmvaGainMethod::kNone:
        break;
    }
    return "none";
}

Emva1288 measure_emva1288(const Capture &capture) {
    return EmvaMeasurement(capture).run();
}

} // namespace clsp
