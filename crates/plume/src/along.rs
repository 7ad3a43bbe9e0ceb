//! The plumes' part of the air along a track: places in columns, each at a time and in a wind of its own.
//!
//! As for maps ([`super::batch`]), the compiler makes vector instructions of the kernel. It knows all
//! but what needs a power (a class between two, a spread of another exponent), a lid and deposition; those are
//! evaluated row by row.

use multiversion::multiversion;
use std::ops::Range;

use super::batch::{PlaceColumns, exp_near};
use super::{
    DispersionModel, LEAST_DISTANCE_M, LEAST_TRANSPORT_M_S, MAX_EXPONENT, Place, Plume, SourceTerm,
    Transport,
};
use crate::effects::HOUR_S;
use crate::sigma::{Curve, Power};

/// Rows handled together: their columns stay in the first-level cache.
const CHUNK: usize = 256;
/// Losses and growth together are within this exponent, so that nothing overflows.
const MOST_GROWTH: f64 = 600.0;

/// Rows of a track in columns of equal length.
#[derive(Debug, Clone, Copy)]
pub(crate) struct RowColumns<'a> {
    /// Where.
    pub places: PlaceColumns<'a>,
    /// When, s.
    pub time_s: &'a [f64],
    /// The wind at the first source's effective height.
    pub wind: &'a [Transport],
    /// ppm of one mol/m³.
    pub ppm_per_mol_m3: &'a [f64],
}

impl RowColumns<'_> {
    /// The true place of a row.
    fn place(&self, i: usize, [east_m, north_m, up_m]: [f64; 3]) -> Place {
        Place {
            east_m: self.places.east_m[i] - east_m,
            north_m: self.places.north_m[i] - north_m,
            height_agl_m: self.places.height_agl_m[i] - up_m,
        }
    }
}

/// One plume with what changes its shape along the way.
#[derive(Debug)]
struct Kernel {
    /// Part of its source's emission.
    share: f64,
    /// East and north of the axis' origin where a sensor would log it, m.
    source: [f64; 2],
    /// Height of the axis there, and depth of its image below the ground, m.
    axis: f64,
    image: f64,
    /// (1/a², b) of σy.
    y: [f64; 2],
    /// (1/a², b) of σz.
    z: [f64; 2],
    power_z: Power,
    ground: f64,
    meander_var_rad2: f64,
    /// Variances with which the plume begins, across and up, m².
    start_var_m2: [f64; 2],
    /// Growth of the emission, 1/s.
    growth_s: f64,
    decay_s: f64,
}

/// Winds at a few rows, as a plume has them, and what its shape is multiplied by.
struct Winds {
    east: [f64; CHUNK],
    north: [f64; CHUNK],
    speed_m_s: [f64; CHUNK],
    strength: [f64; CHUNK],
}

impl DispersionModel {
    /// The plumes' part of the air at `rows`, ppm. What is logged is the true place plus `offset_m`; the
    /// air is that of the true one.
    pub(crate) fn fill_excess(&self, rows: &RowColumns<'_>, offset_m: [f64; 3], out: &mut [f64]) {
        let Some((curve_y, curve_z)) = self.kernel_curves() else {
            for (i, value) in out.iter_mut().enumerate() {
                let place = rows.place(i, offset_m);
                let (molar, direct) = self.excess(&place, rows.time_s[i], rows.wind[i]);
                *value = molar * rows.ppm_per_mol_m3[i] + direct;
            }
            return;
        };
        out.fill(0.0);
        let mut winds = Winds {
            east: [0.0; CHUNK],
            north: [0.0; CHUNK],
            speed_m_s: [0.0; CHUNK],
            strength: [0.0; CHUNK],
        };
        for plume in &self.plumes {
            let kernel = |cell| self.kernel(cell, curve_y, curve_z, offset_m);
            let cells = self.cells[plume.cells.clone()].iter();
            let kernels: Vec<Kernel> = cells.map(kernel).collect();
            for (k, out) in out.chunks_mut(CHUNK).enumerate() {
                let from = k * CHUNK;
                // Of all cells of a source: they are at one height.
                self.fill_winds(plume, rows, offset_m, from..from + out.len(), &mut winds);
                let p = &rows.places;
                let columns = [p.east_m, p.north_m, p.height_agl_m, rows.time_s];
                for kernel in &kernels {
                    add(kernel, &winds, columns.map(|c| &c[from..]), out);
                }
            }
        }
    }

    /// The curves of σy and σz where the kernel knows all plumes.
    fn kernel_curves(&self) -> Option<(Curve, Curve)> {
        let e = &self.effects;
        let unknown = e.sigma_z_exponent != 0.0
            || e.deposition_m_s > 0.0
            || self.reflection.lid_m.is_finite();
        let curves = self.spread.of_one_class()?;
        (!unknown && matches!(curves.0.power, Power::MinusHalf)).then_some(curves)
    }

    fn kernel(
        &self,
        plume: &Plume,
        curve_y: Curve,
        curve_z: Curve,
        [east_m, north_m, up_m]: [f64; 3],
    ) -> Kernel {
        let e = &self.effects;
        let scale_y = self.spec.sigma_y_scale * e.sigma_y_factor;
        let scale_z = self.spec.sigma_z_scale * e.sigma_z_factor;
        Kernel {
            share: plume.share,
            source: [plume.east_m + east_m, plume.north_m + north_m],
            axis: plume.height_m + up_m,
            image: plume.height_m - up_m,
            y: [1.0 / (curve_y.a * scale_y).powi(2), curve_y.b],
            z: [1.0 / (curve_z.a * scale_z).powi(2), curve_z.b],
            power_z: curve_z.power,
            ground: self.reflection.ground,
            meander_var_rad2: e.meander_var_rad2.max(0.0),
            start_var_m2: [
                plume.start_var_m2 + e.wake_var_m2.max(0.0),
                e.wake_var_m2.max(0.0),
            ],
            growth_s: e.emission_trend_h / HOUR_S,
            decay_s: e.decay_s.max(0.0),
        }
    }

    fn fill_winds(
        &self,
        plume: &Plume,
        rows: &RowColumns<'_>,
        offset_m: [f64; 3],
        range: Range<usize>,
        winds: &mut Winds,
    ) {
        for (k, i) in range.enumerate() {
            let place = rows.place(i, offset_m);
            let wind = self.veered(plume, &place, self.turned(rows.wind[i], rows.time_s[i]));
            let speed_m_s = (wind.speed_m_s * self.effects.speed_factor * plume.speed_ratio)
                .max(LEAST_TRANSPORT_M_S);
            winds.east[k] = wind.east;
            winds.north[k] = wind.north;
            winds.speed_m_s[k] = speed_m_s;
            winds.strength[k] = match plume.source_term {
                SourceTerm::MolarRate(q) => q / speed_m_s * rows.ppm_per_mol_m3[i],
                SourceTerm::AxisConcentration(s) => s,
            };
            // An area's cells are so near to its middle that one factor serves all.
            if let Some(schedule) = &plume.schedule {
                let along_m = (place.east_m - plume.east_m) * wind.east
                    + (place.north_m - plume.north_m) * wind.north;
                let under_way_s = along_m.max(LEAST_DISTANCE_M) / speed_m_s;
                winds.strength[k] *= schedule.at(rows.time_s[i] - under_way_s);
            }
        }
    }
}

/// Adds the plume at each row to `out`; columns are east, north, height and time.
#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl", "x86_64+avx2"))]
fn add(kernel: &Kernel, winds: &Winds, columns: [&[f64]; 4], out: &mut [f64]) {
    match kernel.power_z {
        Power::MinusOne => add_form(kernel, winds, columns, out, |bracket| bracket * bracket),
        Power::MinusHalf => add_form(kernel, winds, columns, out, |bracket| bracket),
        Power::Half => add_form(kernel, winds, columns, out, |bracket| 1.0 / bracket),
    }
}

#[inline(always)]
fn add_form(
    kernel: &Kernel,
    winds: &Winds,
    columns: [&[f64]; 4],
    out: &mut [f64],
    shape_z: impl Fn(f64) -> f64,
) {
    let count = out.len().min(CHUNK);
    // Equal lengths known to the compiler: no bounds checks inside the loop.
    let [east, north, height, time_s] = columns.map(|c| &c[..count]);
    let (to_east, to_north) = (&winds.east[..count], &winds.north[..count]);
    let (speed_m_s, strength) = (&winds.speed_m_s[..count], &winds.strength[..count]);
    let [from_east, from_north] = kernel.source;
    for i in 0..count {
        let (de, dn) = (east[i] - from_east, north[i] - from_north);
        let along = de * to_east[i] + dn * to_north[i];
        let y = de * to_north[i] - dn * to_east[i];
        // Upwind places are worked out at the least distance and dropped at the end, as on maps.
        let x = if along < LEAST_DISTANCE_M {
            LEAST_DISTANCE_M
        } else {
            along
        };
        let x_sq = x * x;
        let bracket_z = 1.0 + kernel.z[1] * x;
        let var_y = x_sq / (kernel.y[0] * (1.0 + kernel.y[1] * x))
            + x_sq * kernel.meander_var_rad2
            + kernel.start_var_m2[0];
        let var_z = x_sq / (kernel.z[0] * shape_z(bracket_z)) + kernel.start_var_m2[1];
        let inverse = 1.0 / (var_y * var_z);
        let (precision_y, precision_z) = (var_z * inverse, var_y * inverse);
        let across = 0.5 * (y * y) * precision_y;
        let under_way_s = x / speed_m_s[i];
        let grown = kernel.growth_s * (time_s[i] - under_way_s) - kernel.decay_s * under_way_s;
        let grown = grown.clamp(-MOST_GROWTH, MOST_GROWTH);
        let up = height[i] - kernel.axis;
        let image = height[i] + kernel.image;
        let shape = gauss(across + 0.5 * (up * up) * precision_z, grown)
            + kernel.ground * gauss(across + 0.5 * (image * image) * precision_z, grown);
        let value = kernel.share * strength[i] * inverse.sqrt() * shape;
        out[i] += if along < LEAST_DISTANCE_M { 0.0 } else { value };
    }
}

/// exp(grown − exponent), nothing for exponents beyond [`MAX_EXPONENT`].
#[inline(always)]
fn gauss(exponent: f64, grown: f64) -> f64 {
    // Far out the value is dropped; what is worked out must not overflow.
    let near = if exponent > MAX_EXPONENT {
        MAX_EXPONENT
    } else {
        exponent
    };
    let value = exp_near(grown - near);
    if exponent > MAX_EXPONENT { 0.0 } else { value }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::field::Strength;
    use crate::field::tests::spec;
    use crate::mechanism::Mechanism;
    use proptest::prelude::*;

    proptest! {
        /// Row by row with all that the kernel knows, in a wind of each row's own.
        #[test]
        fn the_kernel_is_the_plain_evaluation(
            rows in proptest::collection::vec(
                (-500.0..9000.0f64, -900.0..900.0f64, 0.0..600.0f64, 0.5..15.0f64), 1..600),
            turned in prop::bool::ANY,
            grown in prop::bool::ANY,
            wide in prop::bool::ANY,
        ) {
            let of = |id: &str, name: &str, value: f64| Mechanism::new(id, &[(name, value)]).unwrap();
            let mut mechanisms = Vec::new();
            if turned {
                mechanisms.push(of("wind-direction-drift", "rate_deg_per_h", 8.0));
                mechanisms.push(of("wind-veer-with-height", "rate_deg_per_100m", 5.0));
            }
            if grown {
                mechanisms.push(of("emission-trend", "rate_per_h", 0.7));
                mechanisms.push(of("first-order-decay", "rate_per_s", 2e-4));
            }
            if wide {
                mechanisms.push(of("meander", "sigma_deg", 4.0));
                mechanisms.push(of("building-downwash", "area_m2", 2500.0));
            }
            let model = DispersionModel::new(crate::DispersionSpec { mechanisms, ..spec(Strength::EmissionKgS(100.0)) }).unwrap();
            let column = |of: fn(&(f64, f64, f64, f64)) -> f64| -> Vec<f64> { rows.iter().map(of).collect() };
            let (east_m, north_m, height_agl_m) = (column(|r| r.0), column(|r| r.1), column(|r| r.2));
            let time_s: Vec<f64> = (0..rows.len()).map(|k| k as f64).collect();
            let wind: Vec<Transport> = rows.iter().map(|r| Transport::new(270.0 + r.3, r.3)).collect();
            let ppm_per_mol_m3 = column(|r| 24.0 + r.3);
            let columns = RowColumns {
                places: PlaceColumns { east_m: &east_m, north_m: &north_m, height_agl_m: &height_agl_m },
                time_s: &time_s,
                wind: &wind,
                ppm_per_mol_m3: &ppm_per_mol_m3,
            };
            let mut out = vec![f64::NAN; rows.len()];
            let offset_m = if turned { [30.0, -20.0, 9.0] } else { [0.0; 3] };
            prop_assert!(model.kernel_curves().is_some());
            model.fill_excess(&columns, offset_m, &mut out);
            for (i, value) in out.iter().enumerate() {
                let place = columns.place(i, offset_m);
                let (molar, direct) = model.excess(&place, time_s[i], wind[i]);
                let plain = molar * ppm_per_mol_m3[i] + direct;
                prop_assert!((value - plain).abs() <= 1e-10 * plain.abs() + 1e-12, "{} {}", value, plain);
            }
        }
    }
}
