//! The mean field at many places at once, for maps and for the search of a maximum.
//!
//! [`DispersionModel::fill_mean_ppm`] takes places in columns. Where the model is a sum of plain Gaussian
//! plumes (whole stability class, no mixing lid, no mechanism that changes the shape along the
//! way) it runs a kernel that the compiler turns into vector instructions, in versions for
//! AVX-512, AVX2 and the plain processor, chosen when the program runs; elsewhere it evaluates
//! [`DispersionModel::mean_ppm`] place by place. Both agree to better than 1e-9 (1e-13 is usual).
//!
//! The kernel uses no fused multiply-add: every operation of IEEE 754 rounds the same in every
//! version, so that a result does not depend on the processor.
//!
//! With 1/σy² = ky (1 + by x)/x² and 1/σz² = kz (1 + bz x)^p/x² (Briggs 1973), both exponents
//! and the amplitude 1/(σy σz) need one division, one square root and one exponential.

use multiversion::multiversion;

use super::{
    DispersionModel, LEAST_DISTANCE_M, LEAST_TRANSPORT_M_S, MAX_EXPONENT, MAX_MOLE_FRACTION_PPM,
    Place, SourceTerm, cos_sin, rotate,
};
use crate::PlumeError;
use crate::effects::HOUR_S;
use crate::sigma::Power;

/// Places handled together: their columns stay in the first-level cache.
const CHUNK: usize = 1024;

/// Places in columns of equal length.
#[derive(Debug, Clone, Copy)]
pub struct PlaceColumns<'a> {
    /// Metres east of the site's origin.
    pub east_m: &'a [f64],
    /// Metres north of the site's origin.
    pub north_m: &'a [f64],
    /// Metres above the site's ground.
    pub height_agl_m: &'a [f64],
}

impl PlaceColumns<'_> {
    /// Number of places.
    fn len(&self) -> usize {
        self.east_m.len()
    }

    fn chunk(&self, from: usize, to: usize) -> PlaceColumns<'_> {
        PlaceColumns {
            east_m: &self.east_m[from..to],
            north_m: &self.north_m[from..to],
            height_agl_m: &self.height_agl_m[from..to],
        }
    }
}

impl DispersionModel {
    /// Mean mole fraction at each of `places` at `time_s`, ppm, as [`DispersionModel::mean_ppm`] has it.
    /// `out` is overwritten and brought to the number of places; nothing else is allocated for
    /// each place.
    ///
    /// # Errors
    /// Columns of different lengths.
    pub fn fill_mean_ppm(
        &self,
        places: PlaceColumns<'_>,
        time_s: f64,
        out: &mut Vec<f64>,
    ) -> Result<(), PlumeError> {
        out.resize(places.len(), 0.0);
        self.write_mean_ppm(places, time_s, out)
    }

    /// The same into what is there already, one number for each place.
    ///
    /// # Errors
    /// Columns of different lengths.
    pub fn write_mean_ppm(
        &self,
        places: PlaceColumns<'_>,
        time_s: f64,
        out: &mut [f64],
    ) -> Result<(), PlumeError> {
        let count = places.len();
        for (name, rows) in [
            ("north_m", places.north_m.len()),
            ("height_agl_m", places.height_agl_m.len()),
            ("the answer", out.len()),
        ] {
            if rows != count {
                return Err(PlumeError::Shape {
                    what: "columns of places",
                    problem: format!("east_m has {count} rows, {name} has {rows}"),
                });
            }
        }
        let Some(kernels) = self.kernels(time_s) else {
            for (i, value) in out.iter_mut().enumerate() {
                *value = self.mean_ppm(&place(&places, i), time_s);
            }
            return Ok(());
        };
        for (k, values) in out.chunks_mut(CHUNK).enumerate() {
            let from = k * CHUNK;
            let chunk = places.chunk(from, from + values.len());
            self.fill_chunk(&kernels, chunk, time_s, values);
        }
        Ok(())
    }

    fn fill_chunk(
        &self,
        kernels: &Kernels,
        places: PlaceColumns<'_>,
        time_s: f64,
        out: &mut [f64],
    ) {
        let PlaceColumns {
            east_m,
            north_m,
            height_agl_m,
        } = places;
        out.fill(0.0);
        for kernel in &kernels.molar {
            add(kernel, east_m, north_m, height_agl_m, out);
        }
        if !kernels.molar.is_empty() {
            // Maps are level: the atmosphere is asked once for each run of equal heights.
            let (mut height, mut factor) = (f64::NAN, f64::NAN);
            for (value, &h) in out.iter_mut().zip(places.height_agl_m) {
                if h != height {
                    (height, factor) = (h, self.ppm_per_mol_m3(h));
                }
                *value *= factor;
            }
        }
        for kernel in &kernels.direct {
            add(kernel, east_m, north_m, height_agl_m, out);
        }
        let e = &self.effects;
        let here = Place::default();
        let background = Background {
            ppm: self.background_ppm(&here, time_s),
            east_ppm_m: e.background_east_ppm_m,
            north_ppm_m: e.background_north_ppm_m,
        };
        add_background(&background, places.east_m, places.north_m, out);
    }

    /// The plumes as kernels; `None` where one of them is more than a plain Gaussian.
    fn kernels(&self, time_s: f64) -> Option<Kernels> {
        let e = &self.effects;
        let shaped = e.veer_deg_100m != 0.0
            || e.meander_var_rad2 != 0.0
            || e.wake_var_m2 != 0.0
            || e.sigma_z_exponent != 0.0
            || e.decay_s > 0.0
            || e.deposition_m_s > 0.0
            || e.emission_trend_h != 0.0
            || self.plumes.iter().any(|p| p.schedule.is_some())
            || self.reflection.lid_m.is_finite()
            || self.spec.sources.iter().any(|s| s.area.is_some());
        let (curve_y, curve_z) = self.spread.of_one_class()?;
        if shaped || !matches!(curve_y.power, Power::MinusHalf) {
            return None;
        }
        let turned = rotate(self.scenario_wind, self.rotation);
        let wind = rotate(turned, cos_sin(e.direction_drift_deg_h * time_s / HOUR_S));
        let scale_y = self.spec.sigma_y_scale * e.sigma_y_factor;
        let scale_z = self.spec.sigma_z_scale * e.sigma_z_factor;
        let mut kernels = Kernels::default();
        for plume in &self.plumes {
            let speed =
                (wind.speed_m_s * e.speed_factor * plume.speed_ratio).max(LEAST_TRANSPORT_M_S);
            let (list, strength) = match plume.source_term {
                SourceTerm::MolarRate(q) => (&mut kernels.molar, q / speed),
                SourceTerm::AxisConcentration(s) => (&mut kernels.direct, s),
            };
            list.push(Kernel {
                strength,
                toward: [wind.east, wind.north],
                source: [plume.east_m, plume.north_m, plume.height_m],
                y: [1.0 / (curve_y.a * scale_y).powi(2), curve_y.b],
                z: [1.0 / (curve_z.a * scale_z).powi(2), curve_z.b],
                power_z: curve_z.power,
                ground: self.reflection.ground,
            });
        }
        Some(kernels)
    }
}

fn place(places: &PlaceColumns<'_>, i: usize) -> Place {
    Place {
        east_m: places.east_m[i],
        north_m: places.north_m[i],
        height_agl_m: places.height_agl_m[i],
    }
}

#[derive(Debug, Default)]
struct Kernels {
    /// In mol/m³.
    molar: Vec<Kernel>,
    /// In ppm.
    direct: Vec<Kernel>,
}

/// One plain Gaussian plume.
#[derive(Debug)]
struct Kernel {
    /// What multiplies exp() / (σy σz).
    strength: f64,
    /// Unit vector of the axis, east and north.
    toward: [f64; 2],
    /// East, north and height of the axis' origin, m.
    source: [f64; 3],
    /// (1/a², b) of σy.
    y: [f64; 2],
    /// (1/a², b) of σz.
    z: [f64; 2],
    power_z: Power,
    ground: f64,
}

/// Adds the plume at each place to `out`. All slices have the same length.
#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl", "x86_64+avx2"))]
fn add(kernel: &Kernel, east: &[f64], north: &[f64], height: &[f64], out: &mut [f64]) {
    let ground = kernel.ground > 0.0;
    match (kernel.power_z, ground) {
        (Power::MinusOne, false) => {
            add_form::<{ MINUS_ONE }, false>(kernel, east, north, height, out)
        }
        (Power::MinusOne, true) => {
            add_form::<{ MINUS_ONE }, true>(kernel, east, north, height, out)
        }
        (Power::MinusHalf, false) => {
            add_form::<{ MINUS_HALF }, false>(kernel, east, north, height, out)
        }
        (Power::MinusHalf, true) => {
            add_form::<{ MINUS_HALF }, true>(kernel, east, north, height, out)
        }
        (Power::Half, false) => add_form::<{ HALF }, false>(kernel, east, north, height, out),
        (Power::Half, true) => add_form::<{ HALF }, true>(kernel, east, north, height, out),
    }
}

/// Background as a plane over the map.
#[derive(Debug)]
struct Background {
    /// At the site's origin.
    ppm: f64,
    east_ppm_m: f64,
    north_ppm_m: f64,
}

/// Makes mole fractions of the excesses in `out`, which are limited to all of the air.
#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl", "x86_64+avx2"))]
fn add_background(background: &Background, east: &[f64], north: &[f64], out: &mut [f64]) {
    let count = out.len();
    let (east, north) = (&east[..count], &north[..count]);
    for i in 0..count {
        // Not f64::min, which would make a number of NaN.
        let excess = if out[i] > MAX_MOLE_FRACTION_PPM {
            MAX_MOLE_FRACTION_PPM
        } else {
            out[i]
        };
        let tilt = background.east_ppm_m * east[i] + background.north_ppm_m * north[i];
        out[i] = excess + (background.ppm + tilt);
    }
}

// The power of σz as a constant generic, so that the loop has no branch on it; Rust takes no enum
// there.
const MINUS_ONE: u8 = 0;
const MINUS_HALF: u8 = 1;
const HALF: u8 = 2;

#[inline(always)]
fn add_form<const POWER: u8, const GROUND: bool>(
    kernel: &Kernel,
    east: &[f64],
    north: &[f64],
    height: &[f64],
    out: &mut [f64],
) {
    let count = out.len();
    // Equal lengths known to the compiler: no bounds checks inside the loop.
    let (east, north, height) = (&east[..count], &north[..count], &height[..count]);
    let [from_east, from_north, axis] = kernel.source;
    let [to_east, to_north] = kernel.toward;
    for i in 0..count {
        let (de, dn) = (east[i] - from_east, north[i] - from_north);
        let along = de * to_east + dn * to_north;
        let y = de * to_north - dn * to_east;
        // Upwind places are worked out at the least distance and dropped at the end: a branch here
        // would keep the loop from being vectorised. Not f64::max, which would make a number of NaN.
        let x = if along < LEAST_DISTANCE_M {
            LEAST_DISTANCE_M
        } else {
            along
        };
        let inverse = 1.0 / x;
        let inverse_sq = inverse * inverse;
        let bracket = 1.0 + kernel.z[1] * x;
        let shape_z = match POWER {
            MINUS_ONE => bracket * bracket,
            MINUS_HALF => bracket,
            _ => 1.0 / bracket,
        };
        let precision_y = kernel.y[0] * (1.0 + kernel.y[1] * x) * inverse_sq;
        let precision_z = kernel.z[0] * shape_z * inverse_sq;
        let across = 0.5 * (y * y) * precision_y;
        let up = height[i] - axis;
        let mut shape = gauss(across + 0.5 * (up * up) * precision_z);
        if GROUND {
            let image = height[i] + axis;
            shape += kernel.ground * gauss(across + 0.5 * (image * image) * precision_z);
        }
        let value = kernel.strength * (precision_y * precision_z).sqrt() * shape;
        out[i] += if along < LEAST_DISTANCE_M { 0.0 } else { value };
    }
}

/// exp(−exponent) for exponents from 0, nothing beyond [`MAX_EXPONENT`]; good to 2e-15.
#[inline(always)]
fn gauss(exponent: f64) -> f64 {
    let value = exp_near(-exponent);
    if exponent > MAX_EXPONENT { 0.0 } else { value }
}

/// exp(t) for |t| < 700 without a branch: t = k ln 2 + r, |r| ≤ ln 2 / 2, a Taylor polynomial of
/// degree 11 in r (remainder 6e-15) and k added to the exponent's bits.
#[inline(always)]
pub(super) fn exp_near(t: f64) -> f64 {
    /// 1.5 · 2^52: adding it rounds to a whole number that stands in the low bits.
    const ROUND: f64 = 6_755_399_441_055_744.0;
    /// ln 2 in two parts; the first has trailing zeros, so that its product with k is exact
    /// (Cody and Waite 1980).
    const LN_2_HIGH: f64 = 0.693_145_751_953_125;
    const LN_2_LOW: f64 = 1.428_606_820_309_417_2e-6;
    const INVERSE_FACTORIALS: [f64; 11] = [
        1.0 / 3_628_800.0,
        1.0 / 362_880.0,
        1.0 / 40_320.0,
        1.0 / 5_040.0,
        1.0 / 720.0,
        1.0 / 120.0,
        1.0 / 24.0,
        1.0 / 6.0,
        0.5,
        1.0,
        1.0,
    ];
    let rounded = t * std::f64::consts::LOG2_E + ROUND;
    let k = rounded - ROUND;
    let r = (t - k * LN_2_HIGH) - k * LN_2_LOW;
    let mut sum = 1.0 / 39_916_800.0;
    for c in INVERSE_FACTORIALS {
        sum = sum * r + c;
    }
    // The low bits of `rounded` are k in two's complement; shifted by 52 they add to the exponent of
    // `sum`, which multiplies it by 2^k.
    f64::from_bits(sum.to_bits().wrapping_add(rounded.to_bits() << 52))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::field::tests::spec;
    use crate::field::{DispersionSpec, Strength};
    use crate::mechanism::Mechanism;
    use crate::sigma::Setting;
    use crate::stability::Stability;
    use proptest::prelude::*;

    type Columns3 = (Vec<f64>, Vec<f64>, Vec<f64>);

    fn filled(model: &DispersionModel, (east_m, north_m, height_agl_m): &Columns3) -> Vec<f64> {
        let places = PlaceColumns {
            east_m,
            north_m,
            height_agl_m,
        };
        let mut out = vec![f64::NAN; 3];
        model.fill_mean_ppm(places, 1800.0, &mut out).unwrap();
        out
    }

    /// Largest relative difference from the plain evaluation, background left out.
    fn worst(model: &DispersionModel, columns: &Columns3) -> f64 {
        let (east_m, north_m, height_agl_m) = columns;
        let places = PlaceColumns {
            east_m,
            north_m,
            height_agl_m,
        };
        let fast = filled(model, columns);
        assert_eq!(fast.len(), east_m.len());
        let mut worst = 0.0f64;
        for (i, &value) in fast.iter().enumerate() {
            let plain = model.mean_ppm(&place(&places, i), 1800.0);
            // At the cut of exp(-50) one may be nothing where the other is 1e-22 of the axis.
            if plain.min(value) == 0.0 {
                assert!(plain.max(value) < 1e-12, "{plain} {value}");
            } else {
                worst = worst.max((value / plain - 1.0).abs());
            }
        }
        worst
    }

    fn places() -> impl Strategy<Value = Columns3> {
        let place = (-500.0..9000.0, -3000.0..3000.0, 0.0..1500.0);
        proptest::collection::vec(place, 0..2500).prop_map(|rows: Vec<(f64, f64, f64)>| {
            let column = |f: fn(&(f64, f64, f64)) -> f64| rows.iter().map(f).collect();
            (column(|r| r.0), column(|r| r.1), column(|r| r.2))
        })
    }

    fn any_spec() -> impl Strategy<Value = DispersionSpec> {
        (
            0usize..6,
            any::<bool>(),
            any::<bool>(),
            any::<bool>(),
            0.3f64..3.0,
        )
            .prop_map(|(class, urban, by_c_max, reflects, scale)| {
                let mut spec = spec(if by_c_max {
                    Strength::CMax {
                        excess_ppm: 410.0,
                        distance_m: 2400.0,
                    }
                } else {
                    Strength::EmissionKgS(352.0)
                });
                spec.background_ppm = 0.0;
                spec.stability = Stability::ALL[class];
                spec.setting = if urban {
                    Setting::Urban
                } else {
                    Setting::Rural
                };
                spec.ground_reflection = reflects;
                spec.sigma_y_scale = scale;
                spec.sigma_z_scale = 1.0 / scale;
                spec
            })
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(96))]
        #[test]
        fn agrees_with_the_plain_version(spec in any_spec(), columns in places(), kind in 0usize..9) {
            let mut spec = spec;
            let mechanism = |id: &str, p: &[(&str, f64)]| Mechanism::new(id, p).unwrap();
            spec.mechanisms = match kind {
                0 => vec![mechanism("wind-direction-offset", &[("offset_deg", 9.0)])],
                1 => vec![mechanism("wind-speed-scale", &[("factor", 0.7)])],
                2 => vec![mechanism("sigma-y-scale", &[("factor", 1.4)])],
                3 => vec![mechanism("stability-class", &[("shift", -0.5)])],
                4 => vec![mechanism("mixing-lid", &[("height_m", 700.0)])],
                _ => Vec::new(),
            };
            let model = DispersionModel::new(spec).unwrap();
            // Half a class from A is A again, so a shift alone does not tell.
            if kind != 3 {
                prop_assert_eq!(model.kernels(1800.0).is_some(), kind != 4);
            }
            prop_assert!(worst(&model, &columns) <= 1e-9);
        }
    }

    #[test]
    fn exponential_is_good_to_a_few_units_in_the_last_place() {
        for i in 0..=500_000 {
            let t = -1e-4 * f64::from(i);
            let off = (exp_near(t) / t.exp() - 1.0).abs();
            assert!(off < 2e-14, "exp({t}) is off by {off:e}");
        }
    }

    #[test]
    fn a_place_that_is_not_finite_gives_what_the_plain_version_gives() {
        let model = DispersionModel::new(spec(Strength::EmissionKgS(352.0))).unwrap();
        let nan = f64::NAN;
        let out = filled(
            &model,
            &(vec![nan, 900.0, 900.0], vec![0.0, nan, 0.0], vec![486.0; 3]),
        );
        assert!(
            out[0].is_nan() && out[1].is_nan() && out[2] > 449.0,
            "{out:?}"
        );
    }

    #[test]
    fn columns_of_different_lengths_are_refused() {
        let model = DispersionModel::new(spec(Strength::EmissionKgS(352.0))).unwrap();
        let places = PlaceColumns {
            east_m: &[1.0, 2.0],
            north_m: &[1.0],
            height_agl_m: &[1.0, 2.0],
        };
        let refused = model.fill_mean_ppm(places, 0.0, &mut Vec::new());
        assert_eq!(
            refused.map_err(|e| e.to_string()),
            Err("columns of places: east_m has 2 rows, north_m has 1".to_string())
        );
    }
}
