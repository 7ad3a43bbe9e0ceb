//! A random scene: wind, stack and plume drawn by a seed.

use air::geo::Enu;
use air::isa::Atmosphere;
use air::wind::{WindProfile, WindSeries};
use plume::sigma::Setting;
use plume::stability::Stability;
use plume::{
    DispersionModel, DispersionSpec, Gas, Place, PlumeError, SensorSpec, SourceSpec, Strength,
    UnsteadyAir, UnsteadySpec,
};
use rand::RngExt as _;
use rand_distr::{Distribution as _, Normal};
use scenario::random::stream;

/// Radius of the circle around the stack in which the team may fly, m.
pub(crate) const ARENA_M: f64 = 3000.0;
/// Least distance of vehicles from the stack, m.
pub(crate) const KEEP_OUT_M: f64 = 800.0;
/// Lowest and highest height that can be asked for, m above ground.
pub(crate) const HEIGHTS_M: [f64; 2] = [100.0, 700.0];
/// Background, ppm.
pub(crate) const BACKGROUND_PPM: f64 = 420.0;
/// White noise of a reading, one standard deviation, ppm: that of the sensor in scenarios/as-pontes.toml.
pub(crate) const NOISE_PPM: f64 = 3.0;
/// The sensor's time constant, s.
const LAG_S: f64 = 1.5;
/// Wind speeds at [`WIND_HEIGHT_M`], m/s: none so strong that a slow aircraft stands still in it.
const WIND_M_S: [f64; 2] = [3.0, 9.0];
/// Height to which they refer, m above ground.
const WIND_HEIGHT_M: f64 = 300.0;
/// Exponent of the wind's profile over open country in neutral air (Irwin 1979).
const WIND_EXPONENT: f64 = 0.15;
/// Heights of the plume's axis, m above ground.
pub(crate) const AXIS_M: [f64; 2] = [200.0, 550.0];
/// The plume's axis turns from the wind as the team knows it by this, one standard deviation, degrees.
pub(crate) const AXIS_SD_DEG: f64 = 15.0;
/// Concentrations on the axis above background at [`C_MAX_AT_M`], ppm; their logarithms are uniform.
pub(crate) const C_MAX_PPM: [f64; 2] = [50.0, 500.0];
/// Distance at which they hold, m.
const C_MAX_AT_M: f64 = 2000.0;
/// The classes that last for hours.
const CLASSES: [Stability; 3] = [Stability::C, Stability::D, Stability::E];

/// What one search flies in. The stack stands at the origin.
#[derive(Debug)]
pub(crate) struct Scene {
    /// The wind as the team knows it and flies in it.
    pub(crate) wind: WindProfile,
    /// The plume.
    pub(crate) model: DispersionModel,
    /// Carries the puffs.
    pub(crate) slow: WindSeries,
    /// Where air is unsteady.
    pub(crate) unsteady: Option<UnsteadyAir>,
    /// Unit vector towards which the known wind blows, east and north.
    pub(crate) downwind: [f64; 2],
    /// Unit vector of the plume's axis, east and north.
    pub(crate) axis: [f64; 2],
    /// The highest mean concentration where the team may fly: on the axis at the keep-out's edge.
    pub(crate) peak: Place,
    /// What it is there, ppm.
    pub(crate) peak_ppm: f64,
}

impl Scene {
    /// The scene of a seed.
    pub(crate) fn new(seed: u64, unsteady: bool) -> Result<Self, PlumeError> {
        let mut rng = stream(seed, "gym/scene");
        let from_deg = rng.random_range(0.0..360.0);
        let speed_m_s = rng.random_range(WIND_M_S[0]..WIND_M_S[1]);
        let stability = CLASSES[rng.random_range(0..CLASSES.len())];
        let height_m = rng.random_range(AXIS_M[0]..AXIS_M[1]);
        let excess_ppm = rng.random_range(C_MAX_PPM[0].ln()..C_MAX_PPM[1].ln()).exp();
        // A standard deviation that is a number above zero makes a distribution.
        let turn_deg = Normal::new(0.0, AXIS_SD_DEG).map_or(0.0, |turn| turn.sample(&mut rng));
        let wind = |from_deg| {
            WindProfile::new(speed_m_s, WIND_HEIGHT_M, from_deg, WIND_EXPONENT).map_err(|e| {
                PlumeError::Shape {
                    what: "wind of a scene",
                    problem: e.to_string(),
                }
            })
        };
        let (known, carries) = (wind(from_deg)?, wind(from_deg + turn_deg)?);
        let model = DispersionModel::new(DispersionSpec {
            ground_amsl_m: 0.0,
            atmosphere: Atmosphere::standard(),
            wind: carries,
            stability,
            setting: Setting::Rural,
            ground_reflection: true,
            mixing_height_m: None,
            lid_edge_m: 0.0,
            background_ppm: BACKGROUND_PPM,
            sources: vec![SourceSpec {
                name: "stack".to_owned(),
                gas: Gas::Co2,
                place: Enu::default(),
                area: None,
                stack_height_m: 0.5 * height_m,
                effective_height_agl_m: height_m,
                strength: Strength::CMax {
                    excess_ppm,
                    distance_m: C_MAX_AT_M,
                },
                schedule: None,
            }],
            sigma_y_scale: 1.0,
            sigma_z_scale: 1.0,
            mechanisms: Vec::new(),
            sensor: sensor(),
        })?;
        let towards = |profile: &WindProfile| {
            let wind = profile.at(WIND_HEIGHT_M);
            let speed = wind.speed_m_s();
            [wind.east_m_s / speed, wind.north_m_s / speed]
        };
        let (downwind, axis) = (towards(&known), towards(&carries));
        let peak = Place {
            east_m: KEEP_OUT_M * axis[0],
            north_m: KEEP_OUT_M * axis[1],
            height_agl_m: height_m,
        };
        let eddies = |name| stream(seed, name);
        Ok(Self {
            slow: WindSeries::constant(carries.at(WIND_HEIGHT_M)),
            unsteady: unsteady.then(|| {
                let spec = UnsteadySpec::default();
                UnsteadyAir::new(
                    &model,
                    spec,
                    eddies("gym/eddies"),
                    eddies("gym/fluctuation"),
                )
            }),
            peak_ppm: model.mean_ppm(&peak, 0.0),
            wind: known,
            model,
            downwind,
            axis,
            peak,
        })
    }

    /// A place along the known wind and across it (to its left), m.
    pub(crate) fn along_across(&self, east_m: f64, north_m: f64) -> [f64; 2] {
        let [e, n] = self.downwind;
        [east_m * e + north_m * n, north_m * e - east_m * n]
    }
}

/// The sensor of every aircraft.
pub(crate) fn sensor() -> SensorSpec {
    SensorSpec {
        time_constant_s: LAG_S,
        noise_sd_ppm: NOISE_PPM,
        ..SensorSpec::default()
    }
}
