//! Units, their spellings and their conversions.

use crate::quantity::Dimension;
use crate::recognise::rank_in;

/// How numbers of one unit become those of a column.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Conversion {
    /// value · factor + offset
    Linear {
        /// Units of the column in one of these.
        factor: f64,
        /// Value of the column where this one is zero.
        offset: f64,
    },
    /// Degrees, minutes and seconds in one cell, with a letter or sign for the side.
    DegreesMinutesSeconds,
    /// Degrees times hundred plus minutes, as in NMEA sentences.
    Nmea,
    /// Mass of a gas in a cubic metre of air, kg; it needs the air's state.
    Mass {
        /// Kilograms per cubic metre in one.
        kg_m3: f64,
    },
}

/// A unit: how it is called and what it does.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Unit {
    /// Its name in mapping files and messages.
    pub name: &'static str,
    /// How numbers of it become those of the column.
    pub conversion: Conversion,
}

const fn linear(name: &'static str, factor: f64, offset: f64) -> Unit {
    Unit {
        name,
        conversion: Conversion::Linear { factor, offset },
    }
}

const KNOT_M_S: f64 = 1852.0 / 3600.0;
const MILE_M: f64 = 1609.344;
const FOOT_M: f64 = 0.3048;
const RADIAN_DEG: f64 = 180.0 / std::f64::consts::PI;
const STANDARD_GRAVITY_M_S2: f64 = air::STANDARD_GRAVITY_M_S2;

/// A unit and how it is written: small letters, digits, `%` and `/`, separated by blanks.
type Known = (Unit, &'static str);

const PLACE: [Known; 5] = [
    (
        linear("deg", 1.0, 0.0),
        "deg degrees degree dd decimaldegrees degn degreesnorth degreeseast dege degreesnorth \
        degreeseast ddeg",
    ),
    (linear("rad", RADIAN_DEG, 0.0), "rad radians"),
    (
        linear("1e-7 deg", 1e-7, 0.0),
        "1e-7deg dege7 deg1e7 degx1e7 1e7deg",
    ),
    (
        Unit {
            name: "dms",
            conversion: Conversion::DegreesMinutesSeconds,
        },
        "dms degminsec",
    ),
    (
        Unit {
            name: "ddmm.mmmm",
            conversion: Conversion::Nmea,
        },
        "ddmm.mmmm nmea ddmm dddmm.mmmm",
    ),
];
const LENGTH: [Known; 5] = [
    (
        linear("m", 1.0, 0.0),
        "m meter meters metre metres mamsl masl magl",
    ),
    (linear("ft", FOOT_M, 0.0), "ft feet foot"),
    (linear("km", 1000.0, 0.0), "km"),
    (linear("cm", 0.01, 0.0), "cm"),
    (linear("mm", 0.001, 0.0), "mm"),
];
const SPEED: [Known; 6] = [
    (
        linear("m/s", 1.0, 0.0),
        "m/s ms ms-1 mps meters/second meter/sec m/sec ms1",
    ),
    (linear("knots", KNOT_M_S, 0.0), "kn kt kts knots knot"),
    (linear("mph", MILE_M / 3600.0, 0.0), "mph mi/h miles/hour"),
    (linear("km/h", 1.0 / 3.6, 0.0), "km/h kmh kph kmph kmh-1"),
    (linear("ft/s", FOOT_M, 0.0), "ft/s fps"),
    (linear("cm/s", 0.01, 0.0), "cm/s cms"),
];
const ANGLE: [Known; 3] = [
    (
        linear("deg", 1.0, 0.0),
        "deg degrees degree degt degtrue degn",
    ),
    (linear("rad", RADIAN_DEG, 0.0), "rad radians radian"),
    (linear("cdeg", 0.01, 0.0), "cdeg centidegrees"),
];
const TEMPERATURE: [Known; 3] = [
    (
        linear("C", 1.0, 0.0),
        "c degc celsius degreescelsius degcelsius degreesc cel degreec",
    ),
    (linear("K", 1.0, -air::isa::ZERO_CELSIUS_K), "k kelvin degk"),
    (
        linear("F", 5.0 / 9.0, -160.0 / 9.0),
        "f degf fahrenheit degreesfahrenheit degreesf",
    ),
];
const PERCENT: [Known; 2] = [
    (linear("%", 1.0, 0.0), "% pct percent %rh rh% pctrh"),
    (linear("share", 100.0, 0.0), "share fraction 0-1 1"),
];
const PRESSURE: [Known; 7] = [
    (
        linear("hPa", 1.0, 0.0),
        "hpa mbar mbars mb millibar millibars",
    ),
    (linear("Pa", 0.01, 0.0), "pa pascal pascals"),
    (linear("kPa", 10.0, 0.0), "kpa"),
    (linear("bar", 1000.0, 0.0), "bar"),
    (linear("mmHg", 1013.25 / 760.0, 0.0), "mmhg torr"),
    (linear("inHg", 33.863_89, 0.0), "inhg inchhg"),
    (linear("atm", 1013.25, 0.0), "atm"),
];
const RATE: [Known; 2] = [
    (
        linear("deg/s", 1.0, 0.0),
        "deg/s degs dps deg/sec degrees/second",
    ),
    (
        linear("rad/s", RADIAN_DEG, 0.0),
        "rad/s rads radians/second rad/sec",
    ),
];
const ACCELERATION: [Known; 3] = [
    (linear("m/s2", 1.0, 0.0), "m/s2 m/s/s ms2 m/s^2 ms-2"),
    (linear("g", STANDARD_GRAVITY_M_S2, 0.0), "g"),
    (
        linear("mg", STANDARD_GRAVITY_M_S2 / 1000.0, 0.0),
        "mg millig",
    ),
];
const SHARE: [Known; 2] = [
    (linear("share", 1.0, 0.0), "share fraction 0-1 1"),
    (linear("%", 0.01, 0.0), "% pct percent"),
];
const DURATION: [Known; 6] = [
    (linear("s", 1.0, 0.0), "s sec secs second seconds"),
    (linear("ms", 1e-3, 0.0), "ms msec millisecond milliseconds"),
    (linear("us", 1e-6, 0.0), "us usec microsecond microseconds"),
    (linear("ns", 1e-9, 0.0), "ns nsec nanosecond nanoseconds"),
    (linear("min", 60.0, 0.0), "min minute minutes"),
    (linear("h", 3600.0, 0.0), "h hr hrs hour hours"),
];
/// Of gases the factors give ppm.
const GAS: [Known; 8] = [
    (
        linear("ppm", 1.0, 0.0),
        "ppm ppmv 1e-6 10-6 umol/mol umolmol-1 umolmol umol/mol-1 ppmdry umolmol1",
    ),
    (
        linear("ppb", 1e-3, 0.0),
        "ppb 1e-9 10-9 ppbv nmol/mol nmolmol-1 nmolmol ppbdry nmolmol1",
    ),
    (linear("ppt", 1e-6, 0.0), "ppt pptv pmol/mol"),
    (linear("%", 1e4, 0.0), "% pct percent vol% %vol volpct"),
    (linear("mol/mol", 1e6, 0.0), "mol/mol molmol-1 1"),
    (linear("mmol/mol", 1e3, 0.0), "mmol/mol mmolmol-1"),
    (
        Unit {
            name: "ug/m3",
            conversion: Conversion::Mass { kg_m3: 1e-9 },
        },
        "ug/m3 ugm3 ugm-3 ug/m^3",
    ),
    (
        Unit {
            name: "mg/m3",
            conversion: Conversion::Mass { kg_m3: 1e-6 },
        },
        "mg/m3 mgm3 mgm-3 mg/m^3",
    ),
];

/// A dimension of each kind.
const DIMENSIONS: [Dimension; 12] = [
    Dimension::Place,
    Dimension::Length,
    Dimension::Speed,
    Dimension::Angle,
    Dimension::Temperature,
    Dimension::Percent,
    Dimension::Pressure,
    Dimension::Rate,
    Dimension::Acceleration,
    Dimension::Share,
    Dimension::Duration,
    Dimension::Gas {
        gas: None,
        unit: plume::units::Unit::Ppm,
    },
];

const fn known(dimension: Dimension) -> &'static [Known] {
    match dimension {
        Dimension::Place => &PLACE,
        Dimension::Length => &LENGTH,
        Dimension::Speed => &SPEED,
        Dimension::Angle => &ANGLE,
        Dimension::Temperature => &TEMPERATURE,
        Dimension::Percent => &PERCENT,
        Dimension::Pressure => &PRESSURE,
        Dimension::Gas { .. } => &GAS,
        Dimension::Rate => &RATE,
        Dimension::Acceleration => &ACCELERATION,
        Dimension::Share => &SHARE,
        Dimension::Duration => &DURATION,
    }
}

impl Unit {
    /// The unit that `text` is for a quantity of `dimension`; none where it is none of them.
    pub fn parse(dimension: Dimension, text: &str) -> Option<Self> {
        let text = plain(text);
        known(dimension)
            .iter()
            .find(|(_, written)| rank_in(written, &text).is_some())
            .map(|(unit, _)| unit.in_column(dimension))
    }

    /// The unit in which the column itself is.
    pub fn own(dimension: Dimension) -> Self {
        let unit = match dimension {
            Dimension::Gas {
                unit: plume::units::Unit::Ppb,
                ..
            } => GAS[1].0,
            _ => known(dimension)[0].0,
        };
        unit.in_column(dimension)
    }

    /// Names of all units of `dimension`, for messages.
    pub fn names(dimension: Dimension) -> String {
        let names: Vec<&str> = known(dimension).iter().map(|(u, _)| u.name).collect();
        names.join(", ")
    }

    /// Whether some quantity has a unit that is written like this.
    pub fn is_any(text: &str) -> bool {
        let text = plain(text);
        let mut written = DIMENSIONS.into_iter().flat_map(known);
        written.any(|(_, written)| rank_in(written, &text).is_some())
    }

    fn in_column(self, dimension: Dimension) -> Self {
        let (Dimension::Gas { unit, .. }, Conversion::Linear { factor, offset }) =
            (dimension, self.conversion)
        else {
            return self;
        };
        // ppb in a column of ppb is what it is, without a rounding.
        let factor = if self.name == unit.as_str() {
            1.0
        } else {
            factor * unit.per_ppm()
        };
        linear(self.name, factor, offset)
    }
}

/// A unit's text in small letters without what only decorates it.
pub(crate) fn plain(text: &str) -> String {
    let mut plain = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '°' | 'º' | '˚' => plain.push_str("deg"),
            '℃' => plain.push_str("degc"),
            '℉' => plain.push_str("degf"),
            'µ' | 'μ' => plain.push('u'),
            '²' => plain.push('2'),
            '³' => plain.push('3'),
            '⁻' | '−' => plain.push('-'),
            '¹' => plain.push('1'),
            '⁄' | '∕' => plain.push('/'),
            '％' => plain.push('%'),
            ' ' | '_' | '\u{a0}' | '(' | ')' | '[' | ']' | '{' | '}' | '"' => {}
            _ => plain.extend(c.to_lowercase()),
        }
    }
    plain
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::quantity::Quantity;

    fn converted(column: &str, unit: &str, value: f64) -> f64 {
        let quantity = Quantity::named(column).unwrap();
        match Unit::parse(quantity.dimension, unit).unwrap().conversion {
            Conversion::Linear { factor, offset } => value * factor + offset,
            other => panic!("{other:?}"),
        }
    }

    // GNU units 2.23: units '10 knots' m/s, '10 mph' m/s, '10 km/hr' m/s, '100 feet' m, 'tempF(50)' tempC,
    // '29.92 inHg' hPa, '760 mmHg' hPa, '1 radian' degree; definitions for the rest.
    #[test]
    fn values_are_those_of_gnu_units() {
        for (column, unit, value, expected) in [
            ("wind_speed_m_s", "knots", 10.0, 5.144_444_4),
            ("wind_speed_m_s", "mph", 10.0, 4.470_4),
            ("wind_speed_m_s", "km/h", 10.0, 2.777_777_8),
            ("alt_amsl_m", "feet", 100.0, 30.48),
            ("temperature_c", "°F", 50.0, 10.0),
            ("temperature_c", "K", 283.15, 10.0),
            ("pressure_hpa", "Pa", 101_325.0, 1013.25),
            ("pressure_hpa", "mbar", 990.0, 990.0),
            ("pressure_hpa", "inHg", 29.92, 1_013.207_6),
            ("pressure_hpa", "mmHg", 760.0, 1013.25),
            ("wind_from_deg", "rad", 1.0, 57.295_779_5),
            ("ch4_ppm", "ppb", 1900.0, 1.9),
            ("ch4_ppb", "ppm", 1.9, 1900.0),
            ("ch4_ppb", "ppb", 1900.0, 1900.0),
            ("co2_ppm", "µmol mol⁻¹", 421.0, 421.0),
            ("co2_ppm", "%", 0.05, 500.0),
        ] {
            let got = converted(column, unit, value);
            assert!(
                (got / expected - 1.0).abs() < 1e-7,
                "{column} {unit}: {got}"
            );
        }
    }

    #[test]
    fn a_unit_of_another_dimension_is_none() {
        assert!(Unit::parse(Dimension::Speed, "hPa").is_none());
        assert!(Unit::parse(Dimension::Temperature, "ppm").is_none());
    }
}
