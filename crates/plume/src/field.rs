//! The mean concentration field: Gaussian plumes of several sources on a background.
//!
//! c = Q/(2π u σy σz) exp(−y²/2σy²) V(z), with V(z) = exp(−(z−H)²/2σz²) and, where switched on,
//! its images in the ground and the lid (Seinfeld and Pandis 2016, section 18.9); or, Q unknown, c = c_MAX(x) exp(−y²/2σy²) V(z) with
//! c_MAX(x) carried from where it was measured by the ratio of σy σz.
//!
//! **Calm.** The formula has no answer without wind. Below [`LEAST_TRANSPORT_M_S`] the plume is
//! carried at that speed along the given direction, and [`DispersionModel::notices`] says so.

use air::geo::{Enu, Geodetic, LocalFrame};
use air::isa::Atmosphere;
use air::wind::{WindProfile, towards_deg};
use std::ops::Range;
use std::sync::Arc;

use self::reflection::Reflection;
use crate::area::{AreaSpec, Cell};
use crate::effects::{DispersionEffects, HOUR_S};
use crate::mechanism::Mechanism;
use crate::schedule::Schedule;
use crate::sensor::SensorSpec;
use crate::sigma::{Setting, Spread};
use crate::stability::Stability;
use crate::units::Gas;
use crate::{PlumeError, in_range};

/// Least speed at which a plume is carried, m/s: half a metre per second, the usual calm limit
/// of regulatory models (US EPA, AERMOD: 0.5 m/s and below is calm or meander).
pub const LEAST_TRANSPORT_M_S: f64 = 0.5;
/// Nearest distance downwind at which the plume is evaluated, m: both sigmas go to zero at the
/// source, where the formula has a pole.
const LEAST_DISTANCE_M: f64 = 1.0;
/// Exponent y²/2σy² + (z−H)²/2σz² beyond which the concentration is zero: exp(−50) is 2e-22 of that
/// on the axis, far below any sensor's resolution.
const MAX_EXPONENT: f64 = 50.0;
/// The whole of the air, ppm: near a strong source the formula gives more, which no gas can be.
const MAX_MOLE_FRACTION_PPM: f64 = 1e6;

/// A place relative to the site's origin.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Place {
    /// Metres east.
    pub east_m: f64,
    /// Metres north.
    pub north_m: f64,
    /// Metres above the site's ground.
    pub height_agl_m: f64,
}

impl Place {
    /// The place at latitude, longitude and altitude in the frame of the site.
    pub fn from_geodetic(frame: &LocalFrame, at: Geodetic, alt_amsl_m: f64) -> Self {
        let Enu { east_m, north_m } = frame.to_enu(at);
        Self {
            east_m,
            north_m,
            height_agl_m: alt_amsl_m - frame.ground_amsl_m,
        }
    }
}

/// How strong a source is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Strength {
    /// Mass of its gas per time, kg/s.
    EmissionKgS(f64),
    /// The axis concentration above background measured at a distance downwind.
    CMax {
        /// Above background on the axis, ppm.
        excess_ppm: f64,
        /// Where, m downwind.
        distance_m: f64,
    },
}

/// Distance at which c_MAX is stated for a source given by its emission, m.
const C_MAX_DISTANCE_M: f64 = 1000.0;

impl Strength {
    /// Distance downwind at which this strength's c_MAX is stated, m: its own, or 1 km.
    pub fn c_max_distance_m(&self) -> f64 {
        match *self {
            Self::CMax { distance_m, .. } => distance_m,
            Self::EmissionKgS(_) => C_MAX_DISTANCE_M,
        }
    }
}

/// A stack, or an area.
#[derive(Debug, Clone, PartialEq)]
pub struct SourceSpec {
    /// Its name in messages.
    pub name: String,
    /// What it emits.
    pub gas: Gas,
    /// Where it stands; of an area its middle.
    pub place: Enu,
    /// The ground that emits; `None`: a stack.
    pub area: Option<AreaSpec>,
    /// Height of its mouth above ground, m.
    pub stack_height_m: f64,
    /// Height at which its plume levels off above ground, m.
    pub effective_height_agl_m: f64,
    /// How strong it is; with a schedule in the mean of its time.
    pub strength: Strength,
    /// How its emission changes over time; none where it is steady.
    pub schedule: Option<Schedule>,
}

/// All that a mean field, and the sensor that reads it, depend on.
#[derive(Debug, Clone, PartialEq)]
pub struct DispersionSpec {
    /// Height of the site's ground above mean sea level, m.
    pub ground_amsl_m: f64,
    /// Temperature and pressure with height.
    pub atmosphere: Atmosphere,
    /// Mean wind with height.
    pub wind: WindProfile,
    /// Pasquill class.
    pub stability: Stability,
    /// Rural or urban.
    pub setting: Setting,
    /// Whether the ground sends the plume back.
    pub ground_reflection: bool,
    /// Height of the mixing lid above ground, m; `None`: no lid.
    pub mixing_height_m: Option<f64>,
    /// Standard deviation of the height at which a lid ends the plume, m: zero where heights are
    /// exact, and with logged ones how well those are known.
    pub lid_edge_m: f64,
    /// Background mole fraction, ppm.
    pub background_ppm: f64,
    /// The sources; the sensor reads those of the first one's gas.
    pub sources: Vec<SourceSpec>,
    /// Factor of Briggs' σy.
    pub sigma_y_scale: f64,
    /// Factor of Briggs' σz.
    pub sigma_z_scale: f64,
    /// Extensions.
    pub mechanisms: Vec<Mechanism>,
    /// The sensor of every platform.
    pub sensor: SensorSpec,
}

/// Which way and how fast the air moves at the first source's effective height.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Transport {
    /// East part of the unit vector towards which it moves.
    pub east: f64,
    /// North part of the same.
    pub north: f64,
    /// Speed at the first source's effective height, m/s.
    pub speed_m_s: f64,
}

impl Transport {
    /// From a direction *from* which the wind blows and a speed.
    pub fn new(from_deg: f64, speed_m_s: f64) -> Self {
        let (east, north) = towards_deg(from_deg).to_radians().sin_cos();
        Self {
            east,
            north,
            speed_m_s,
        }
    }

    /// Towards `east` and `north`, of any length; none where both are nothing.
    pub fn towards(east: f64, north: f64, speed_m_s: f64) -> Option<Self> {
        let length = east.hypot(north);
        (length > 0.0).then(|| Self {
            east: east / length,
            north: north / length,
            speed_m_s,
        })
    }

    /// How long air is under way for so many metres, s; in a calm as at [`LEAST_TRANSPORT_M_S`].
    pub fn under_way_s(&self, way_m: f64) -> f64 {
        way_m / self.speed_m_s.max(LEAST_TRANSPORT_M_S)
    }

    /// The same turned clockwise, seen from above, by degrees.
    pub fn turned(self, clockwise_deg: f64) -> Self {
        rotate(self, cos_sin(clockwise_deg))
    }
}

/// Where a place lies in a plume.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct InPlume {
    /// Distance downwind of the source, m.
    pub distance_m: f64,
    /// Distance across the axis over σy.
    pub across_sigmas: f64,
    /// Height above the axis over σz.
    pub above_sigmas: f64,
    /// σz there, m.
    pub sigma_z_m: f64,
}

/// A source, or a cell of one, with all mechanisms applied.
#[derive(Debug, Clone)]
struct Plume {
    east_m: f64,
    north_m: f64,
    height_m: f64,
    /// Transport speed at this source's height over that at the first one's.
    speed_ratio: f64,
    source_term: SourceTerm,
    depletion: Option<Arc<Depletion>>,
    /// Its emission over time, over that of its source term.
    schedule: Option<Schedule>,
    /// Part of its source's emission.
    share: f64,
    /// Variance across the wind with which the plume begins, m²: that of an area.
    start_var_m2: f64,
    /// Of a source: where its cells stand among the model's.
    cells: Range<usize>,
}

impl Plume {
    /// The plume of a cell.
    fn of_cell(&self, cell: &Cell, variance_m2: f64) -> Self {
        Self {
            east_m: self.east_m + cell.east_m,
            north_m: self.north_m + cell.north_m,
            source_term: self.source_term.times(cell.share),
            share: cell.share,
            start_var_m2: variance_m2,
            ..self.clone()
        }
    }
}

/// The part of the formula that does not depend on the place.
#[derive(Debug, Clone, Copy)]
enum SourceTerm {
    /// Q/(2π M), mol/s.
    MolarRate(f64),
    /// c_MAX σy σz where it was measured, ppm m².
    AxisConcentration(f64),
}

impl SourceTerm {
    fn times(self, factor: f64) -> Self {
        match self {
            Self::MolarRate(rate) => Self::MolarRate(rate * factor),
            Self::AxisConcentration(strength) => Self::AxisConcentration(strength * factor),
        }
    }
}

/// A validated model: the mean field at any place and time.
#[derive(Debug, Clone)]
pub struct DispersionModel {
    spec: DispersionSpec,
    effects: DispersionEffects,
    /// One for each source.
    plumes: Vec<Plume>,
    /// What the field is the sum of: the plume of each stack and of each cell of an area.
    cells: Vec<Plume>,
    spread: Spread,
    reflection: Reflection,
    rotation: (f64, f64),
    scenario_wind: Transport,
    notices: Vec<String>,
}

impl DispersionModel {
    /// Validates a specification and prepares it for evaluation.
    ///
    /// # Errors
    /// A value out of range, or no source.
    pub fn new(spec: DispersionSpec) -> Result<Self, PlumeError> {
        validate(&spec)?;
        let effects = DispersionEffects::of(&spec.mechanisms);
        let reflection = Reflection {
            ground: (f64::from(u8::from(spec.ground_reflection)) + effects.ground_coefficient)
                .clamp(0.0, 1.0),
            lid_m: effects
                .lid_m
                .min(spec.mixing_height_m.unwrap_or(f64::INFINITY)),
            lid_edge_m: spec.lid_edge_m,
        };
        let first_height = spec.sources[0].effective_height_agl_m;
        let mut model = Self {
            spread: Spread::new(spec.stability, effects.class_shift, spec.setting),
            rotation: cos_sin(effects.direction_offset_deg),
            scenario_wind: transport(&spec.wind, first_height),
            plumes: Vec::with_capacity(spec.sources.len() + effects.second_sources.len()),
            cells: Vec::new(),
            notices: notices(&spec),
            spec,
            effects,
            reflection,
        };
        let first_gas = model.spec.sources[0].gas;
        for i in 0..model.spec.sources.len() {
            if model.spec.sources[i].gas == first_gas {
                let plume = model.plume(&model.spec.sources[i], 0.0, 0.0, 0.0, 1.0);
                model.add(plume, model.spec.sources[i].area);
            }
        }
        let area = model.spec.sources[0].area;
        for i in 0..model.effects.second_sources.len() {
            let s = &model.effects.second_sources[i];
            let first = &model.spec.sources[0];
            let plume = model.plume(first, s.east_m, s.north_m, s.height_offset_m, s.ratio);
            model.add(plume, area);
        }
        // Last, since what is lost depends on the sigmas and the reflection of the whole model.
        if model.effects.deposition_m_s > 0.0 {
            for i in 0..model.plumes.len() {
                let depletion = Some(Arc::new(Depletion::new(&model, &model.plumes[i])));
                for cell in &mut model.cells[model.plumes[i].cells.clone()] {
                    cell.depletion.clone_from(&depletion);
                }
                model.plumes[i].depletion = depletion;
            }
        }
        Ok(model)
    }

    /// Takes up a source's plume, with its cells.
    fn add(&mut self, mut plume: Plume, area: Option<AreaSpec>) {
        let first = self.cells.len();
        match area {
            None => self.cells.push(plume.clone()),
            Some(area) => {
                let variance_m2 = area.cell_variance_m2();
                let of = |cell: &Cell| plume.of_cell(cell, variance_m2);
                self.cells.extend(area.cells().iter().map(of));
                plume.start_var_m2 = area.variance_m2();
            }
        }
        plume.cells = first..self.cells.len();
        self.plumes.push(plume);
    }

    fn plume(&self, source: &SourceSpec, east: f64, north: f64, up: f64, ratio: f64) -> Plume {
        let base_height = source.effective_height_agl_m + up;
        let first_height = self.spec.sources[0].effective_height_agl_m;
        let reference = self.spec.wind.speed_at_m_s(first_height);
        let factor = ratio * self.effects.emission_factor;
        let height_m = (base_height + self.effects.height_offset_m).max(0.0);
        let source_term = match source.strength {
            Strength::EmissionKgS(q) => SourceTerm::MolarRate(
                q * factor / (std::f64::consts::TAU * source.gas.molar_mass_kg_mol()),
            ),
            Strength::CMax {
                excess_ppm,
                distance_m,
            } => SourceTerm::AxisConcentration(
                excess_ppm * factor / self.shape_on_axis(distance_m, height_m),
            ),
        };
        Plume {
            east_m: source.place.east_m + east + self.effects.source_east_m,
            north_m: source.place.north_m + north + self.effects.source_north_m,
            height_m,
            // By the heights that the scenario states: an offset found from readings moves the axis
            // and leaves the wind that was stated or logged for it.
            speed_ratio: if reference > 0.0 && base_height != first_height {
                self.spec.wind.speed_at_m_s(base_height) / reference
            } else {
                1.0
            },
            source_term,
            depletion: None,
            schedule: source.schedule.clone(),
            share: 1.0,
            start_var_m2: 0.0,
            cells: 0..0,
        }
    }

    /// V/(σy σz) on a stack's axis at a height, images and all, 1/m².
    fn shape_on_axis(&self, distance_m: f64, height_m: f64) -> f64 {
        let (y, z) = self.sigmas_m(distance_m);
        self.reflection.profile(height_m, height_m, z, 0.0) / (y * z)
    }

    /// The specification this model was made from.
    pub fn spec(&self) -> &DispersionSpec {
        &self.spec
    }

    /// What a user should know: calm wind, sources that the sensor does not read.
    pub fn notices(&self) -> &[String] {
        &self.notices
    }

    /// Mean mole fraction at a place and time in the scenario's wind, ppm.
    pub fn mean_ppm(&self, place: &Place, time_s: f64) -> f64 {
        self.ppm(place, time_s, self.scenario_wind)
    }

    /// Concentration above background on the first source's axis at `distance_m` in the scenario's
    /// wind at time 0, ppm: where the mechanisms have the axis.
    pub fn axis_excess_ppm(&self, distance_m: f64) -> f64 {
        let on_first = self.on_axes(distance_m, 0.0).next();
        on_first.map_or(0.0, |place| {
            self.mean_ppm(&place, 0.0) - self.background_ppm(&place, 0.0)
        })
    }

    /// The place on the axis of each plume at a distance from its source, in the scenario's wind.
    pub fn on_axes(&self, distance_m: f64, time_s: f64) -> impl Iterator<Item = Place> {
        let wind = self.turned(self.scenario_wind, time_s);
        self.plumes.iter().map(move |plume| Place {
            east_m: plume.east_m + distance_m * wind.east,
            north_m: plume.north_m + distance_m * wind.north,
            height_agl_m: plume.height_m,
        })
    }

    /// The c_MAX that states the first source's strength at `distance_m`, ppm: with it instead of its own
    /// strength, and the same mechanisms, the model is the same. It knows the spread with all
    /// mechanisms, and nothing of those that change the emission, the axis or what is lost on the way.
    pub fn stated_c_max_ppm(&self, distance_m: f64) -> f64 {
        let plume = &self.plumes[0];
        let per_shape = match plume.source_term {
            SourceTerm::AxisConcentration(strength) => strength,
            SourceTerm::MolarRate(rate) => {
                let speed = self.scenario_wind.speed_m_s.max(LEAST_TRANSPORT_M_S);
                rate / speed * self.ppm_per_mol_m3(plume.height_m)
            }
        };
        per_shape / self.effects.emission_factor * self.shape_on_axis_of(plume, distance_m)
    }

    /// V/(σy σz) of all cells of a source, by their shares, on the axis from its middle in the scenario's wind,
    /// 1/m².
    fn shape_on_axis_of(&self, plume: &Plume, distance_m: f64) -> f64 {
        let cells = &self.cells[plume.cells.clone()];
        if cells.len() == 1 {
            return self.shape_on_axis(distance_m, plume.height_m);
        }
        let wind = self.scenario_wind;
        let place = Place {
            east_m: plume.east_m + distance_m * wind.east,
            north_m: plume.north_m + distance_m * wind.north,
            height_agl_m: plume.height_m,
        };
        let of = |cell: &Plume| {
            let at = downwind_m(cell, &place, wind);
            at.map_or(0.0, |(x, y)| {
                cell.share * self.cross_section(cell, &place, x, y)
            })
        };
        cells.iter().map(of).sum()
    }

    /// What the sources of the first one's gas emit in the model's wind, kg/s, by name: the scenario's in its
    /// order, then those that mechanisms add, under the mechanism's name. What the model holds is the ratio of
    /// emission to wind.
    pub fn emissions_kg_s(&self) -> Vec<(String, f64)> {
        let gas = self.spec.sources[0].gas;
        let stated = self.spec.sources.iter().filter(|s| s.gas == gas);
        let added = 1..=self.effects.second_sources.len();
        let names = stated
            .map(|s| s.name.clone())
            .chain(added.map(added_source));
        let of = |plume: &Plume| {
            let mol_s = match plume.source_term {
                SourceTerm::MolarRate(rate) => rate,
                SourceTerm::AxisConcentration(strength) => {
                    let own_m_s = self.scenario_wind.speed_m_s * plume.speed_ratio;
                    strength * own_m_s / self.ppm_per_mol_m3(plume.height_m)
                }
            };
            std::f64::consts::TAU * mol_s * gas.molar_mass_kg_mol()
        };
        names.zip(self.plumes.iter().map(of)).collect()
    }

    fn ppm(&self, place: &Place, time_s: f64, wind: Transport) -> f64 {
        self.with_background(self.excess(place, time_s, wind), place, time_s)
    }

    /// Mole fraction where plumes add (mol/m³ of those given by emission, ppm of those given by c_MAX), ppm.
    fn with_background(&self, (molar, direct): (f64, f64), place: &Place, time_s: f64) -> f64 {
        let mut excess = direct;
        if molar > 0.0 {
            excess += molar * self.ppm_per_mol_m3(place.height_agl_m);
        }
        self.background_ppm(place, time_s) + excess.min(MAX_MOLE_FRACTION_PPM)
    }

    /// ppm of one mol/m³ of gas at a height above ground.
    pub(crate) fn ppm_per_mol_m3(&self, height_agl_m: f64) -> f64 {
        let amsl = self.spec.ground_amsl_m + height_agl_m;
        1e6 / self.spec.atmosphere.at(amsl).molar_density_mol_m3()
    }

    /// Background with its mechanisms, ppm.
    #[inline]
    pub fn background_ppm(&self, place: &Place, time_s: f64) -> f64 {
        self.spec.background_ppm
            + self.effects.background_ppm
            + self.effects.background_ppm_h * time_s / HOUR_S
            + self.effects.background_east_ppm_m * place.east_m
            + self.effects.background_north_ppm_m * place.north_m
    }

    /// Spread (σy, σz) in m at `x_m` downwind, with all mechanisms.
    #[inline]
    pub fn sigmas_m(&self, x_m: f64) -> (f64, f64) {
        let e = &self.effects;
        let (y, z) = self.spread.at(x_m);
        let mut y = y * self.spec.sigma_y_scale * e.sigma_y_factor;
        let mut z = z * self.spec.sigma_z_scale * e.sigma_z_factor;
        if e.sigma_z_exponent != 0.0 {
            z *= (x_m / 1000.0).powf(e.sigma_z_exponent);
        }
        // An axis that swings adds its own variance to that about the axis (Gifford 1959).
        if e.meander_var_rad2 > 0.0 {
            y = (y * y + x_m * x_m * e.meander_var_rad2).sqrt();
        }
        // A wake mixes the plume at its start, whatever the turbulence does later (Gifford 1975).
        if e.wake_var_m2 > 0.0 {
            y = (y * y + e.wake_var_m2).sqrt();
            z = (z * z + e.wake_var_m2).sqrt();
        }
        (y, z)
    }

    /// The spread of a plume, which may begin with that of an area.
    #[inline(always)]
    fn sigmas_of_m(&self, plume: &Plume, x_m: f64) -> (f64, f64) {
        let (y, z) = self.sigmas_m(x_m);
        if plume.start_var_m2 == 0.0 {
            return (y, z);
        }
        ((y * y + plume.start_var_m2).sqrt(), z)
    }

    /// Where a place is from each source that it is downwind of: along the wind and across, m.
    pub(crate) fn downwind_of_sources_m(
        &self,
        place: &Place,
        wind: Transport,
    ) -> impl Iterator<Item = (f64, f64)> {
        let of = move |plume: &Plume| downwind_m(plume, place, wind);
        self.cells.iter().filter_map(of)
    }

    /// The scenario's wind at the first source's effective height.
    pub fn transport(&self) -> Transport {
        self.scenario_wind
    }

    /// Where a place lies in the plume of the first source, in air that moves as `wind` at the source's
    /// effective height and as the mechanisms have it; none upwind of the source.
    pub fn in_first_plume(&self, place: &Place, time_s: f64, wind: Transport) -> Option<InPlume> {
        let plume = self.plumes.first()?;
        let wind = self.veered(plume, place, self.turned(wind, time_s));
        let (distance_m, across_m) = downwind_m(plume, place, wind)?;
        let (sigma_y_m, sigma_z_m) = self.sigmas_of_m(plume, distance_m);
        Some(InPlume {
            distance_m,
            across_sigmas: across_m / sigma_y_m,
            above_sigmas: (place.height_agl_m - plume.height_m) / sigma_z_m,
            sigma_z_m,
        })
    }

    /// A wind as the mechanisms turn it.
    #[inline]
    fn turned(&self, wind: Transport, time_s: f64) -> Transport {
        let turned = rotate(wind, self.rotation);
        match self.effects.direction_drift_deg_h {
            0.0 => turned,
            rate => rotate(turned, cos_sin(rate * time_s / HOUR_S)),
        }
    }

    /// Excess of all plumes as (mol/m³ of those given by emission, ppm of those given by c_MAX).
    #[inline]
    pub(crate) fn excess(&self, place: &Place, time_s: f64, wind: Transport) -> (f64, f64) {
        let mut turned = self.turned(wind, time_s);
        turned.speed_m_s *= self.effects.speed_factor;
        let mut sum = (0.0, 0.0);
        for plume in &self.cells {
            let (shape, x, speed) = self.shape_with_losses(plume, place, turned);
            // The air here at time_s passed the source one travel time x/u before.
            let shape = shape * self.emission_growth(plume, time_s - x / speed);
            match plume.source_term {
                SourceTerm::MolarRate(strength) => sum.0 += strength * shape / speed,
                SourceTerm::AxisConcentration(strength) => sum.1 += strength * shape,
            }
        }
        sum
    }

    /// Emission of a source at a time over that which its strength states.
    #[inline]
    fn emission_growth(&self, plume: &Plume, emitted_s: f64) -> f64 {
        let grown = match self.effects.emission_trend_h {
            0.0 => 1.0,
            rate => (rate * emitted_s / HOUR_S).exp(),
        };
        grown * plume.schedule.as_ref().map_or(1.0, |s| s.at(emitted_s))
    }

    /// exp() V(z) losses / (σy σz), the distance downwind and the transport speed.
    // Left to itself the compiler calls this and the next row by row: a fit takes a tenth longer.
    #[inline(always)]
    fn shape_with_losses(&self, plume: &Plume, place: &Place, wind: Transport) -> (f64, f64, f64) {
        let (spread, x, speed) = self.gaussian_shape(plume, place, wind);
        (spread * self.surviving_fraction(plume, x, speed), x, speed)
    }

    /// The wind as it is at the height of a place, if it is `wind` at that of the plume.
    #[inline]
    fn veered(&self, plume: &Plume, place: &Place, wind: Transport) -> Transport {
        let veer_deg_100m = self.effects.veer_deg_100m;
        if veer_deg_100m == 0.0 {
            return wind;
        }
        let up_m = place.height_agl_m - plume.height_m;
        rotate(wind, cos_sin(veer_deg_100m * up_m / 100.0))
    }

    /// The part that losses leave at a distance downwind.
    #[inline]
    fn surviving_fraction(&self, plume: &Plume, x_m: f64, speed_m_s: f64) -> f64 {
        let e = &self.effects;
        let mut fraction = 1.0;
        if e.decay_s > 0.0 {
            fraction *= (-e.decay_s * x_m / speed_m_s).exp();
        }
        if let Some(depletion) = &plume.depletion {
            fraction *= depletion.surviving_fraction(x_m, e.deposition_m_s / speed_m_s);
        }
        fraction
    }

    /// exp() V(z) / (σy σz), the distance downwind and the transport speed.
    #[inline(always)]
    fn gaussian_shape(&self, plume: &Plume, place: &Place, wind: Transport) -> (f64, f64, f64) {
        let wind = self.veered(plume, place, wind);
        let speed = (wind.speed_m_s * plume.speed_ratio).max(LEAST_TRANSPORT_M_S);
        let Some((x, y)) = downwind_m(plume, place, wind) else {
            return (0.0, 0.0, speed);
        };
        (self.cross_section(plume, place, x, y), x, speed)
    }

    /// exp() V(z) / (σy σz) at a distance downwind and across, m.
    #[inline(always)]
    fn cross_section(&self, plume: &Plume, place: &Place, x: f64, y: f64) -> f64 {
        let (sigma_y, sigma_z) = self.sigmas_of_m(plume, x);
        let across = 0.5 * (y / sigma_y) * (y / sigma_y);
        if across > MAX_EXPONENT {
            return 0.0;
        }
        let vertical = self
            .reflection
            .profile(place.height_agl_m, plume.height_m, sigma_z, across);
        vertical / (sigma_y * sigma_z)
    }
}

/// Loss of a plume to the ground with distance: Chamberlain's source depletion.
///
/// ln(Q(x)/Q0) = −(v/u) √(2/π) (1+r)/2 ∫ exp(−H²/2σz²)/σz dx, where 1+r stands for the
/// direct and the reflected plume at the ground (Chamberlain 1953; Horst 1977, equation 2).
#[derive(Debug, Clone)]
struct Depletion {
    /// ∫ at the nodes of distance [`DEPLETION_FIRST_M`] · exp(i / [`DEPLETION_PER_E`]): the velocity
    /// and the speed stand before it, so that it serves every wind. Equal steps of ln x, since σz is
    /// nearly a power of x.
    integral: Vec<f64>,
}

const DEPLETION_NODES: usize = 96;
const DEPLETION_FIRST_M: f64 = 10.0;
/// Nodes per factor e of distance: ten metres to over a hundred kilometres.
const DEPLETION_PER_E: f64 = 10.0;

impl Depletion {
    fn new(model: &DispersionModel, plume: &Plume) -> Self {
        let weight = (2.0 / std::f64::consts::PI).sqrt() * 0.5 * (1.0 + model.reflection.ground);
        let at = |x: f64| {
            let z = model.sigmas_m(x).1;
            weight * (-0.5 * (plume.height_m / z).powi(2)).exp() / z
        };
        let node = |i: usize| DEPLETION_FIRST_M * (i as f64 / DEPLETION_PER_E).exp();
        let mut integral = Vec::with_capacity(DEPLETION_NODES);
        // Up to the first node the plume of a raised source has not reached the ground.
        let mut sum = at(DEPLETION_FIRST_M) * DEPLETION_FIRST_M;
        integral.push(sum);
        for i in 1..DEPLETION_NODES {
            let (a, b) = (node(i - 1), node(i));
            // Simpson's rule in each interval.
            sum += (b - a) / 6.0 * (at(a) + 4.0 * at(0.5 * (a + b)) + at(b));
            integral.push(sum);
        }
        Self { integral }
    }

    /// Part of the plume left at `x_m` for a ratio v/u.
    fn surviving_fraction(&self, x_m: f64, velocity_ratio: f64) -> f64 {
        let place = ((x_m / DEPLETION_FIRST_M).ln() * DEPLETION_PER_E)
            .clamp(0.0, (DEPLETION_NODES - 1) as f64);
        let i = (place as usize).min(DEPLETION_NODES - 2);
        let part = place - i as f64;
        let integral = self.integral[i] * (1.0 - part) + self.integral[i + 1] * part;
        (-velocity_ratio * integral).exp()
    }
}

/// Where a place downwind of a source is, along the wind and across, m; none upwind of it.
#[inline]
fn downwind_m(plume: &Plume, place: &Place, wind: Transport) -> Option<(f64, f64)> {
    let (de, dn) = (place.east_m - plume.east_m, place.north_m - plume.north_m);
    let x = de * wind.east + dn * wind.north;
    if x < LEAST_DISTANCE_M {
        return None;
    }
    Some((x, de * wind.north - dn * wind.east))
}

/// (cos, sin) of a turn of the from-direction, clockwise positive. No turn is exactly none, and the
/// common case costs no sine.
#[inline]
pub(crate) fn cos_sin(deg: f64) -> (f64, f64) {
    if deg == 0.0 {
        return (1.0, 0.0);
    }
    let (sin, cos) = deg.to_radians().sin_cos();
    (cos, sin)
}

/// The wind turned clockwise, seen from above: east and north stand left-handed to a compass's
/// angle, hence the signs.
#[inline]
pub(crate) fn rotate(wind: Transport, (cos, sin): (f64, f64)) -> Transport {
    Transport {
        east: wind.east * cos + wind.north * sin,
        north: wind.north * cos - wind.east * sin,
        speed_m_s: wind.speed_m_s,
    }
}

fn transport(wind: &WindProfile, height_m: f64) -> Transport {
    Transport::new(wind.from_deg(), wind.speed_at_m_s(height_m))
}

/// Name of the `n`-th source that a mechanism adds.
fn added_source(n: usize) -> String {
    let name = crate::MechanismId::SecondSource.as_str();
    if n == 1 {
        name.to_owned()
    } else {
        format!("{name} {n}")
    }
}

fn notices(spec: &DispersionSpec) -> Vec<String> {
    let mut out = Vec::new();
    let height = spec.sources[0].effective_height_agl_m;
    let speed = spec.wind.speed_at_m_s(height);
    if speed < LEAST_TRANSPORT_M_S {
        out.push(format!(
            "calm: {speed:.2} m/s at {height:.0} m; the plume is carried at {LEAST_TRANSPORT_M_S} m/s from {:.0} \
             degrees, so its concentrations are right to an order of magnitude at best",
            spec.wind.from_deg()
        ));
    }
    for source in &spec.sources[1..] {
        if source.gas != spec.sources[0].gas {
            out.push(format!(
                "source \"{}\" emits {}, which the sensor for {} does not measure",
                source.name,
                source.gas.as_str(),
                spec.sources[0].gas.as_str()
            ));
        }
    }
    out
}

fn validate(spec: &DispersionSpec) -> Result<(), PlumeError> {
    if spec.sources.is_empty() {
        return Err(PlumeError::NoSource);
    }
    in_range("ground_amsl_m", spec.ground_amsl_m, -500.0, 9000.0)?;
    in_range(
        "background, ppm",
        spec.background_ppm,
        0.0,
        MAX_MOLE_FRACTION_PPM,
    )?;
    in_range("sigma_y_scale", spec.sigma_y_scale, 0.01, 100.0)?;
    in_range("sigma_z_scale", spec.sigma_z_scale, 0.01, 100.0)?;
    if let Some(lid) = spec.mixing_height_m {
        in_range("mixing_height_m", lid, 10.0, 20_000.0)?;
    }
    in_range("lid_edge_m", spec.lid_edge_m, 0.0, 1000.0)?;
    for s in &spec.sources {
        let of = |what: &str| format!("{what} of source \"{}\"", s.name);
        if let Some(area) = &s.area {
            area.validate(&s.name)?;
        }
        in_range(&of("east_m"), s.place.east_m, -1e6, 1e6)?;
        in_range(&of("north_m"), s.place.north_m, -1e6, 1e6)?;
        in_range(&of("stack_height_m"), s.stack_height_m, 0.0, 1000.0)?;
        in_range(
            &of("effective_height_m"),
            s.effective_height_agl_m,
            0.0,
            5000.0,
        )?;
        match s.strength {
            Strength::EmissionKgS(q) => {
                in_range(&of("emission_kg_s"), q, 0.0, 1e6)?;
            }
            Strength::CMax {
                excess_ppm,
                distance_m,
            } => {
                in_range(&of("c_max_ppm"), excess_ppm, 0.0, MAX_MOLE_FRACTION_PPM)?;
                in_range(&of("c_max_distance_m"), distance_m, LEAST_DISTANCE_M, 1e5)?;
            }
        }
    }
    spec.sensor.validate()
}

#[path = "along.rs"]
pub(crate) mod along;

#[path = "batch.rs"]
pub mod batch;

#[path = "puffs.rs"]
pub mod puffs;

#[path = "reflection.rs"]
mod reflection;

#[cfg(test)]
#[path = "field_tests.rs"]
pub(crate) mod tests;
