// Every number that steers the inference, with its unit, what it gates and its evidence. The rest of this folder, the
// run and the verdict decide by no number of their own; tests/house/test_thresholds.py keeps it so.
//
// Above each number: unit | what it gates | evidence. The evidence is a test, or what a page measured, that shows what
// the number does; a law that it follows from; or "work": it decides how much is simulated, no more. Squared distances
// are of whitened differences, by chance 1 for each statistic. A part, or times, is a ratio.
#pragma once

#include <cstddef>
#include <cstdint>

namespace clsp {

struct Thresholds {
    // What a strength is and how far it goes: 0 is the catalogue's weakest, 1 its strongest.
    struct Strengths {
        // strength | a search begins there, where most effects do little |
        // tests/diagnosis/inference/test_attribution.cpp StrengthsEndWhereValuesDo
        double weakest = -0.8;
        // strength | the same, where equal steps are equal ratios: the effect fades and does not turn; a fit goes so
        // far down only where the effect shows |
        // tests/diagnosis/run/test_diagnose.cpp AnEffectFadesBelowTheCatalogue
        double faintest = -3.0;
        // deviations a strength | below the first of these two, an effect that changes less goes no further down |
        // tests/diagnosis/run/test_diagnose.cpp AnEffectFadesBelowTheCatalogue
        double least_slope = 2.0;
        // strength | simulated strengths that are nearer to each other tell no power law to go by below them |
        // tests/diagnosis/inference/test_attribution.cpp FadesByThePowerLawOfItsWeakest
        double least_reach = 0.4;
        // strength | a second search stays below, once one went beyond: far out an effect imitates others |
        // docs/results/archive.md Out of focus
        double common = 1.3;
        // strength | standard deviation of what lies beyond that, or off the only value that the catalogue has |
        // tests/diagnosis/inference/test_swap.cpp WhatTheCatalogueHasIsLikelier
        double deviation = 0.15;
        // strength | a search ends there; a fit goes on where its last step leads beyond |
        // tests/diagnosis/inference/test_swap.cpp AFitGoesOnWhereTheSearchEnds
        double strongest = 2.0;
        // strength | grid on which a fit looks for its best | work
        double grid_step = 0.02;
        // strength | a strength so near to a simulated one is not simulated | work
        double near = 0.06;
        // strength | an effect below is fitted and not named: fits scatter by less than that |
        // tests/diagnosis/measure/test_verdict.cpp WhatIsFarWeakerThanTheCatalogueHasItIsNotNamed
        double slight = -0.25;
        // strength | beyond the end of every range; deviation of what a capture says nothing of |
        // tests/diagnosis/inference/test_parameters.cpp OfWhichTheCaptureSaysNothing
        double unbounded = 1e3;
        // times | range to both sides of a parameter that the catalogue does not vary |
        // tests/diagnosis/inference/test_attribution.cpp FormsAreChosenNotFitted
        double room = 2.0;
        // part of the range | the same, where the range lies on both sides of 0 |
        // tests/diagnosis/inference/test_attribution.cpp WhatGoesBothWays
        double room_around_zero = 0.125;
        // part | ends of a range of ratios whose product is 1 to this are one the inverse of the other |
        // tests/diagnosis/inference/test_attribution.cpp RangesAroundOne
        double around_one = 0.01;
        // counts | where a count of 0 lies on a scale of ratios | tests/diagnosis/inference/test_attribution.cpp
        // ACountMayBeNone
        double count_of_none = 0.25;
        // times | dark noise that is more than this many times the data sheet's sets the ranges in DN |
        // tests/diagnosis/inference/test_attribution.cpp RangesInDnGoWithTheCamera
        double sheet_noise = 2.0;
    } strengths;

    // What the simulator is known to get wrong.
    struct ModelError {
        // part of a change | added to the deviation of what they change | docs/results/gap-check.md Where the catalogue
        // leaves a choice
        double of_effects = 0.025;
        // part of the above | counted in the intervals of parameters; by 0 42 of 45 hold the truth of another
        // simulator, by this 86 of 91 others | docs/results/gap-check.md
        double of_effects_in_intervals = 0.3;
        // captures | tell what the image's border does | tests/diagnosis/run/test_image_border.py
        std::size_t bordered_captures = 24;
        // deviations | means that a border moves by less are chance, once in 80 | law: normal distribution
        double border_mean = 2.5;
        // times | variances that a border raises by less are chance, once in 100 | law: F distribution of 24 and 48
        // captures
        double border_variance = 2.2;
        // deviations | least deviation of a part of the replicates: what is rare may miss in one part |
        // tests/diagnosis/inference/test_attribution.cpp WhatIsRareIsNoCertainty
        double rare = 0.3;
        // pixels | simulated on each side and cut off, for the image's border |
        // tests/diagnosis/run/test_image_border.py
        std::uint32_t border_px = 24;
    } model_error;

    // Which effects get a fit.
    struct Screening {
        // part | an effect whose promise is less than this part of the best one's is not fitted | work
        double least_gain_part = 0.2;
        // part of the above | the same in a second search of a large gap | tests/diagnosis/run/test_search.py
        // test_what_bends_is_screened_along_lines
        double patient_gain_part = 0.25;
        // times | so many times as many effects are fitted while no fit bears out a promise |
        // tests/diagnosis/run/test_search.py
        std::uint32_t more_patient = 2;
        // effects | a later screening simulates those that promised most before | work
        std::size_t most = 14;
        // squared distance | and only those that promise this at least | work
        double least_promise = 4.0;
        // squared distance of a statistic | a gap beyond is large: effects bend on their way |
        // tests/diagnosis/run/test_diagnose.cpp LargeGapsAreExplainedPartByPart
        double large = 200.0;
        // part of the gap | of a large one: where no effect promises more, all are screened at two strengths |
        // tests/diagnosis/run/test_search.py test_what_bends_is_screened_along_lines
        double poor = 0.5;
        // part of the gap | once a fit explains more, those that promised less than the next number need none | work
        double nearly_all = 0.97;
        // part of the best promise | see above | work
        double least_beside_that = 0.5;
        // strength | the two strengths of screening along lines | tests/diagnosis/run/test_search.py
        // test_what_bends_is_screened_along_lines
        double line_strengths[2] = {0.5, 1.0};
    } screening;

    // Whether an effect is added.
    struct Growth {
        // -2 ln likelihood ratio | an effect that gains less is worth no parameter | docs/results/gap-check.md False
        // alarms by number of frames
        double least_gain = 14.0;
        // part of what is left | while some is left, an effect that explains less is none | docs/results/gap-check.md
        // Effects outside the catalogue
        double least_share = 0.12;
        // part of what is left | the same, once little is left | docs/results/gap-check.md Latest result
        double least_share_of_little = 0.04;
        // part of the first gap | less is little; effects are swapped there | tests/diagnosis/run/test_search.py
        // test_of_two_swaps_the_better_is_made
        double little_left = 0.02;
        // squared distance | effects so near to the best are compared by replicates |
        // tests/diagnosis/measure/test_verdict.cpp LikelihoodRatiosByHalf
        double final_margin = 20.0;
        // part of the best gain | or so near | tests/diagnosis/measure/test_verdict.cpp LikelihoodRatiosByHalf
        double final_margin_share = 0.15;
        // part of what is left | where the best explains less, the others are compared however far behind |
        // tests/diagnosis/inference/test_parameters.cpp OfPowerThatFlickers
        double doubtful = 0.25;
        // rounds | of the fit of one strength | work
        int fit_rounds = 3;
        // swaps | of a search | work
        int most_swaps = 3;
        // times | likelihood ratios count by half: the fits' error is of the order of the data's |
        // tests/diagnosis/measure/test_verdict.cpp LikelihoodRatiosByHalf
        double temperature = 2.0;
    } growth;

    // How strengths are fitted.
    struct Fit {
        // rounds | Gauss-Newton rounds with slopes of their own | work
        int rounds = 2;
        // rounds | more of them, with secants | tests/diagnosis/inference/test_swap.cpp
        // SecantsReachStrengthsThatAreFar
        int secant_rounds = 4;
        // strength | after them a step that long is left to the last, linear one |
        // tests/diagnosis/inference/test_swap.cpp SecantsReachStrengthsThatAreFar
        double far = 0.15;
        // strength | a linear step is trusted so far | tests/diagnosis/inference/test_swap.cpp
        double largest_step = 0.4;
        // strength | finite difference of a slope | tests/diagnosis/run/test_diagnose.cpp
        // NamesTheEffectAndItsParameter
        double difference = 0.15;
        // part of it | with less room the difference goes the other way |
        // tests/diagnosis/run/test_diagnose.cpp AValueNearTheEndOfItsRangeHasAnInterval
        double least_difference = 0.5;
        // deviations | a whole unit of strength that moves statistics less says nothing |
        // tests/diagnosis/inference/test_parameters.cpp OfWhichTheCaptureSaysNothing
        double nothing_said = 1e-6;
        // times | a round whose squared distance grew by more is taken back | tests/diagnosis/inference/test_swap.cpp
        double much_worse = 1.5;
        // rounds | have a chance, however far they are | work
        int patience = 2;
        // rounds | that gain nothing end a quick fit | work
        int idle_rounds = 2;
        // captures | of common random numbers in a search; fits use all | work
        std::uint32_t search_seeds = 1;
        // captures | on either side of a strength measure its slope in the end |
        // tests/diagnosis/inference/test_parameters.cpp WhereAStatisticBendsSharply
        std::size_t slope_seeds = 4;
        // probability | a residual less likely needs no further replicates | work
        double no_doubt = 1e-9;
        // probability | a residual less likely may come of an effect that resembles the true one |
        // tests/diagnosis/inference/test_swap.cpp AnEffectThatResemblesTheTrueOne
        double seldom = 0.05;
        // probability | what is left and less likely starts a second search | docs/method/inference.md How effects are
        // searched for
        double beyond_doubt = 1e-6;
        // times | as many replicates for a residual in doubt | tests/diagnosis/inference/test_swap.cpp
        // ADoubtfulResidualIsConfirmed
        std::uint32_t confirming = 2;
        // part of the level | a residual less likely than this part of the level is in no doubt |
        // tests/diagnosis/inference/test_swap.cpp ADoubtfulResidualIsConfirmed
        double part_of_level = 0.1;
        // strength | a last step that is shorter needs no finer fit | tests/diagnosis/inference/test_swap.cpp
        // AFitIsPolishedWhereStatisticsBend
        double least_step = 0.004;
        // part of a difference | differences of a finer fit | tests/diagnosis/inference/test_swap.cpp
        // AFitIsPolishedWhereStatisticsBend
        double fine = 0.15;
        // squared distance | a finer fit that gains less is not judged | work
        double least_polish = 2.0;
        // part of what is left | nor one that gains a smaller part | work
        double least_polish_part = 0.02;
        // part of the squared distance | a whole number one further is fitted if it leaves less |
        // tests/diagnosis/inference/test_swap.cpp WholeNumbersGoOneFurther
        double whole_step = 0.8;
        // squared distance | another form of an effect must be better by this than the catalogue's own |
        // tests/diagnosis/run/test_forms.py
        double form_margin = 20.0;
        // folds | of the replicates, by whose others' covariance a fit strays |
        // tests/diagnosis/inference/test_parameters.cpp
        int stray_folds = 6;
    } fit;

    // Whether an effect takes another one's place.
    struct Swap {
        // effects | simulated in the place of each one: those that promise most beside it |
        // tests/diagnosis/inference/test_swap.cpp AnEffectThatResemblesTheTrueOne
        std::size_t most_simulated = 6;
        // effects | tried in the place of each one: those that promise most there |
        // tests/diagnosis/inference/test_swap.cpp AnEffectThatResemblesTheTrueOne
        std::size_t most_in_place = 2;
        // effects | tried beside all that are there | tests/diagnosis/inference/test_swap.cpp WhatIsMissingIsAdded
        std::size_t most_added = 5;
        // part of what is lost | where nothing is left, an effect is tried that makes up more of what goes |
        // tests/diagnosis/run/test_search.py test_a_confusable_effect_is_swapped
        double confusable = 0.6;
        // swaps | get a whole fit | tests/diagnosis/run/test_search.py test_of_two_swaps_the_better_is_made
        std::size_t most_whole = 2;
        // squared distance | quick fits differ by less by chance | tests/diagnosis/run/test_search.py
        // test_of_two_swaps_the_better_is_made
        double quickly_alike = 40.0;
        // rounds | of a quick fit | work
        int quick_rounds = 8;
        // times | a quick fit ends that leaves so many times the present squared distance | work
        double give_up = 4.0;
        // part | a round of a quick fit that gains less is idle | work
        double least_round_gain = 0.02;
        // squared distance of a statistic | a quick fit may be wrong by what chance leaves |
        // tests/diagnosis/inference/test_swap.cpp WhatIsMissingIsAdded
        double quick_error = 0.9;
        // part of what is left | a swap that explains less gets no whole fit | work
        double least_explained = 0.2;
        // squared distance | an effect whose loss costs more at once is needed |
        // tests/diagnosis/inference/test_swap.cpp NeedlessEffectsArePruned
        double least_needed = 60.0;
        // squared distance | the same, after a fit of the others | tests/diagnosis/inference/test_swap.cpp
        // NeedlessEffectsArePruned
        double least_worth = 30.0;
        // squared distance | a swap or a form that is worse by more gets no finer fit | work
        double give_up_form = 60.0;
    } swap;

    // How levels and noise are brought to the real ones.
    struct Calibration {
        // frames | of a first round | work
        std::uint32_t trial_frames = 4;
        // rounds | where noise is wide against codes | work
        int rounds = 3;
        // rounds | where it is not, and behind clipping | tests/diagnosis/run/test_cameras.py
        // test_noise_of_two_codes_of_twelve_bits
        int exact_rounds = 6;
        // rounds | of a root between brackets | work
        int root_rounds = 20;
        // converter steps per deviation | coarser codes show no slope: levels are found between brackets | law: Widrow
        // and Kollar, Quantization Noise, 4
        double coarse = 2.5;
        // deviations per converter step | finer noise than that shows codes' ripple: levels are brought to it with all
        // frames | law: (2 / pi) sin(pi / m) exp(-2 (pi sigma / m)^2)
        double smooth = 3.1;
        // part of the standard error | to which a mean is brought there | tests/diagnosis/run/test_cameras.py
        // test_noise_of_two_codes_of_twelve_bits
        double part_of_error = 0.25;
        // part of the signal | to which it is brought elsewhere | work
        double part_of_signal = 1e-3;
        // deviations | a dark level that is closer to 0 is cut off there | law: once in 30,000 codes
        double clipping = 4.0;
        // deviations | of a level that is lower too little shows | law: once in 44 codes
        double least_shown = -2.0;
        // deviations | mean code above 0 that such a level has | law: clipped Gaussian
        double least_mean_shown = 0.11;
        // ratio | a secant that says less, or more than one over that, is chance | tests/diagnosis/run/test_cameras.py
        double least_slope = 0.25;
        // part | to either side of a data sheet's read noise that is looked through |
        // tests/diagnosis/inference/test_attribution.cpp ReadNoiseThatDoesNotShowIsTheDataSheets
        double noise_range = 0.3;
        // read noises | at which coarse frames are simulated | tests/diagnosis/inference/test_attribution.cpp
        // ReadNoiseShowsBetweenCoarseSteps
        std::size_t noise_points = 5;
        // steps | of the likelihood between them | work
        std::size_t noise_steps = 600;
        // squared deviations | of a flat that no read noise explains: it counts no further |
        // tests/diagnosis/inference/test_attribution.cpp ReadNoiseShowsBetweenCoarseSteps
        double most_square = 9.0;
        // DN | that is simulated | tests/diagnosis/run/test_cameras.py
        double least_read_noise = 0.05;
        // DN | deviation of a data sheet's black level | tests/diagnosis/run/test_diagnose.cpp
        // WithoutDarkFramesADataSheetIsNoCertainty
        double sheet_black_level = 2.0;
        // part | deviation of a data sheet's read noise | tests/diagnosis/run/test_diagnose.cpp
        // WithoutDarkFramesADataSheetIsNoCertainty
        double sheet_read_noise = 0.1;
        // captures | tell the sampling error of a coarse variance | work
        int scatter_draws = 8;
    } calibration;

    // What of the light is the lab's.
    struct Illumination {
        // blocks | across the longer side: wide against grain, narrow against what is smooth |
        // tests/diagnosis/inference/test_illumination.cpp
        std::size_t blocks = 12;
        // blocks | across the shorter side | tests/diagnosis/inference/test_illumination.cpp
        // AStripTellsTheImagesFallOff
        std::size_t least_blocks = 6;
        // pixels | a side of a block | tests/diagnosis/inference/test_illumination.cpp
        std::size_t least_block_px = 8;
        // probability | a slope or a fall-off less likely by chance is there |
        // tests/diagnosis/inference/test_illumination.cpp EvenLightIsEven
        double certain = 1e-4;
        // deviations | two fall-offs that differ by less are one, the lens's |
        // tests/diagnosis/inference/test_illumination.cpp TheLensHasWhatBothLightsShare
        double agree = 3.0;
        // probability | two slopes that differ more by chance are one |
        // tests/diagnosis/inference/test_illumination.cpp ASlopeOfBothIsNoLights
        double alike = 0.01;
        // degree | of the polynomial of smooth light | tests/diagnosis/inference/test_illumination.cpp
        int degree = 2;
        // degree | of the one that it is held against | tests/diagnosis/inference/test_illumination.cpp
        // WhatTheLensHasNotIsTheBeams
        int high_degree = 4;
    } illumination;

    // What is said in the end.
    struct Naming {
        // probability | a rival that is as probable is equivalent | tests/diagnosis/measure/test_verdict.cpp
        // EqualRivalsAreEquivalent
        double least_probability = 0.05;
        // deviations | statistics that an effect moves by more are its own; one without any is not named beside others
        // | tests/diagnosis/measure/test_verdict.cpp BySignificantDeviationsAlone
        double own_statistics = 4.0;
        // mean square of z | beside an unknown cause an effect counts if its own statistics have less left |
        // tests/diagnosis/measure/test_verdict.cpp ByTheStatisticsThatAnEffectMoves
        double explained = 3.0;
        // part of the gap | an effect that takes more imitates an unknown cause, and tells its stage |
        // tests/diagnosis/measure/test_verdict.cpp ACauseThatAKnownEffectImitatesLiesWhereThatDoes
        double imitation = 0.5;
        // DN | a lit sequence with less has no level to be simulated at |
        // tests/diagnosis/run/test_diagnose.cpp NamesNothingThatCannotShow
        double least_light_dn = 0.5;
        // pixels | of the common random numbers of a fit; smaller captures take more seeds |
        // tests/diagnosis/run/test_diagnose.cpp SmallCapturesAreFittedByMoreRandomNumbers
        double usual_pixels = 2.0 * 40 * 192 * 160;
        // captures | of common random numbers | tests/diagnosis/run/test_diagnose.cpp
        // SmallCapturesAreFittedByMoreRandomNumbers
        double least_seeds = 2.0;
        // captures | of common random numbers | work
        double most_seeds = 12.0;
        // pixels | a sequence whose mask leaves fewer is not judged | tests/diagnosis/run/test_diagnose.cpp
        // NamesNothingThatCannotShow
        int least_pixels = 64;
    } naming;

    // What a comparison of two finished sets needs beside all that.
    struct Comparison {
        // DN^2 | less noise does not hide which codes a multiplication leaves out | law: exp(-2 pi^2 / 4)
        double least_added_variance = 0.25;
        // part | light levels that differ by more are told | tests/diagnosis/run/test_compare.cpp
        double noted_ratio = 0.02;
        // rounds | of the fit of one strength | work
        int fit_rounds = 2;
        // effects | of those that the simulated set has and the real one has not |
        // tests/diagnosis/run/test_compare.cpp
        std::size_t surplus_told = 3;
    } comparison;
};

inline constexpr Thresholds kThresholds{};
inline constexpr const auto &kStrengths = kThresholds.strengths;
inline constexpr const auto &kModelError = kThresholds.model_error;
inline constexpr const auto &kScreening = kThresholds.screening;
inline constexpr const auto &kGrowth = kThresholds.growth;
inline constexpr const auto &kFit = kThresholds.fit;
inline constexpr const auto &kSwap = kThresholds.swap;
inline constexpr const auto &kCalibration = kThresholds.calibration;
inline constexpr const auto &kIllumination = kThresholds.illumination;
inline constexpr const auto &kNaming = kThresholds.naming;
inline constexpr const auto &kComparison = kThresholds.comparison;

} // namespace clsp
