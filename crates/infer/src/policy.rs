//! Every number by which the inference decides, with its reason.

use crate::noise::Noise;
use crate::probability::CauseMap;

/// Probability from which a cause is named: 19 to 1.
pub const NAMED: f64 = 0.95;

/// Numbers by which the inference decides. None has the unit of a concentration: sizes follow the
/// sensor's noise and the plume, so that an answer is the same in ppm and in ppb.
#[derive(Debug, Clone, PartialEq)]
pub struct Policy {
    /// Width of the discrepancy's basis functions in the logarithm of distance: a plume's spread is a
    /// power of distance over a factor of two, not much less (Briggs 1973 against Pasquill).
    pub discrepancy_width_ln_distance: f64,
    /// The same in height and across, in standard deviations of the plume: a profile that is not
    /// Gaussian differs from it over about one.
    pub discrepancy_width_sigmas: f64,
    /// The same in the time at which the air left the source, s: an emission that is on and off by turns of
    /// a minute is seen, what is faster is a fluctuation.
    pub discrepancy_width_s: f64,
    /// Width of the axis drift's basis functions, s: about as long as a pass, so that each pass may meet the plume in a
    /// direction of its own, and what turns within a pass is wander.
    pub axis_drift_width_s: f64,
    /// Most basis functions of the axis drift, and of the discrepancy in time.
    pub most_basis_functions_in_time: usize,
    /// Height and distance across beyond which a plume is nothing, in standard deviations.
    pub discrepancy_reach_sigmas: f64,
    /// Most basis functions of one coordinate: keeps the cost linear in a record's length.
    pub discrepancy_most_basis_functions: usize,
    /// Sizes of the discrepancy that are tried on each coordinate besides none: a tenth, and the
    /// factor of 1.5 within which a good dispersion model has half of its readings (Chang and Hanna
    /// 2004 ask for a factor of two).
    pub discrepancy_sizes: [f64; 2],
    /// Size of the discrepancy on each coordinate where it is none: no plume is Gaussian to a
    /// hundredth.
    pub discrepancy_least: f64,
    /// Sizes of the drift of the axis to the sides that are tried besides none, degrees: a wind that veers within an hour,
    /// ordinary air (`noise_tolerated`), and a wind that turns.
    pub axis_drift_sizes_deg: [f64; 3],
    /// Ratio of the size of the axis drift up and down to that of the drift to the sides: that of the neutral spectra of
    /// vertical and lateral wind at low frequencies, √(2.1 / 17) (Kaimal and others 1972). Above the size of ordinary air the
    /// drift up and down does not grow.
    pub upward_over_sideways: f64,
    /// Standard deviation of the axis drift's mean over a record, degrees: a steady turn is no axis drift.
    pub axis_drift_mean_deg: f64,
    /// Standard deviation of the straight line through an axis drift over a record, degrees; infinite where no
    /// cause stands for a turn that grows.
    pub axis_drift_slope_deg: f64,
    /// Probability beforehand that a coordinate has no discrepancy: a third then have none at all.
    pub discrepancy_none: f64,
    /// What is known of the noise beforehand: median of each size and memory, sizes of white and
    /// slow noise as multiples of the sensor's own. The axis forgets its wander as eddies pass: those of the plume's own
    /// size in some seconds, the largest of the layer in some minutes (Taylor 1938).
    pub noise_median: Noise,
    /// One standard deviation of the natural logarithm of each, in the same order.
    pub noise_ln_sd: [f64; Noise::PARAMETERS],
    /// Noise beyond these sizes is a deviation from ordinary air and sensors; white and slow noise as multiples of the
    /// sensor's own, memories of any length. Concentrations inside a plume of a steady source fluctuate by .5 to 1.5 of
    /// their mean (Mylne and Mason 1991), a sensor's zero drifts by up to three times its noise, and the axis of a plume
    /// wanders by some degrees about a wind that is logged elsewhere (σθ of a neutral layer is 10°: Pasquill 1961). Up and
    /// down it wanders by at most half of the variance of the mean plume, of which meander is a part (Gifford 1959).
    pub noise_tolerated: Noise,
    /// About how many passes a record is cut into.
    pub passes: usize,
    /// An innovation beyond this many standard deviations is a spike where it is short: one in
    /// 16,000 of normal noise.
    pub spike_sd: f64,
    /// A spike lasts at most this part of the time in which the track crosses one standard
    /// deviation of the plume: what lasts longer may be a plume.
    pub spike_part_of_crossing: f64,
    /// Logarithm of how probable one cause of the catalogue is beforehand: of about thirty causes a
    /// scenario has one in one of three cases.
    pub ln_name: f64,
    /// Most mechanisms of one set.
    pub most_names: usize,
    /// Sets that are fitted at each step of the search, those from which it goes on, and nats below
    /// the best at which it does not.
    pub beam_fits: usize,
    /// See above.
    pub beam_width: usize,
    /// Starts of causes that are looked for beside the first mechanism.
    pub beam_causes: usize,
    /// See above.
    pub beam_nats: f64,
    /// A cause is named at this probability: 19 to 1.
    pub named: f64,
    /// ... and stated, with that probability, where it is likelier than not.
    pub stated: f64,
    /// A cause that is not stated makes the verdict doubtful from this probability on: of causes below it that gain much, five of
    /// seven were found where nothing is hidden.
    pub doubted: f64,
    /// The probability of a cause, by 366 cases of the benchmark's two generators (`crates/gap-bench/fit_probability.py`).
    pub cause_map: CauseMap,
    /// A mechanism that does not stand is a candidate where a parameter of it departs from doing nothing by so many standard
    /// deviations.
    pub departs_sd: f64,
    /// A discrepancy is said where its evidence exceeds this, nats: 99 to 1, as a model that is right
    /// shows so much by chance in one record of a hundred at most.
    pub rest_nats: f64,
    /// ... where held-out passes gain by it; beyond this, nats, in any case, as an axis drift or a fluctuation
    /// of one pass tells nothing of another: 160,000 to 1.
    pub rest_alone_nats: f64,
    /// Most candidates where something is not explained.
    pub most_candidates: usize,
    /// Longest step of a search: standard deviations of the priors.
    pub longest_step_sd: f64,
    /// Most steps of one fit.
    pub most_steps: usize,
    /// A fit is settled when a step promises less than this, nats.
    pub settled_nats: f64,
    /// A part of the posterior with less than this share of the largest is ignored.
    pub least_weight: f64,
}

impl Default for Policy {
    fn default() -> Self {
        Self {
            discrepancy_width_ln_distance: 0.35,
            discrepancy_width_sigmas: 1.0,
            discrepancy_width_s: 30.0,
            axis_drift_width_s: 60.0,
            most_basis_functions_in_time: 40,
            discrepancy_reach_sigmas: 3.0,
            discrepancy_most_basis_functions: 24,
            discrepancy_sizes: [0.1, 0.4],
            discrepancy_least: 0.01,
            axis_drift_sizes_deg: [3.0, 5.0, 15.0],
            upward_over_sideways: 0.35,
            axis_drift_mean_deg: 0.3,
            axis_drift_slope_deg: f64::INFINITY,
            discrepancy_none: 0.75,
            noise_median: Noise {
                white: 1.0,
                slow: 0.3,
                slow_s: 100.0,
                fluctuation: 0.1,
                fluctuation_s: 5.0,
                wander_deg: 1.0,
                wander_s: 25.0,
                wander_sigma_z: 0.05,
            },
            noise_ln_sd: [0.7, 0.5, 0.5, 0.8, 0.8, 1.0, 1.0, 1.5],
            noise_tolerated: Noise {
                white: 6.0,
                slow: 3.0,
                slow_s: f64::INFINITY,
                fluctuation: 1.5,
                fluctuation_s: f64::INFINITY,
                wander_deg: 5.0,
                wander_s: f64::INFINITY,
                wander_sigma_z: 0.7,
            },
            passes: 16,
            spike_sd: 4.0,
            spike_part_of_crossing: 0.5,
            ln_name: -4.6,
            most_names: 3,
            beam_fits: 8,
            beam_causes: 30,
            beam_width: 3,
            beam_nats: 4.0,
            named: NAMED,
            stated: 0.5,
            doubted: 0.3,
            cause_map: CauseMap {
                constant: -3.40,
                slopes: [-1.51, 2.23, -0.41],
            },
            departs_sd: 2.0,
            rest_nats: 4.595,
            rest_alone_nats: 12.0,
            most_candidates: 4,
            longest_step_sd: 1.0,
            most_steps: 20,
            settled_nats: 0.1,
            least_weight: 1e-3,
        }
    }
}
