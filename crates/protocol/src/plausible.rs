//! What numbers messages from outside may hold. They are looked at where a message comes in over the network: one wind
//! of 1e300 m/s would leave a vehicle's state without a finite number for the rest of the mission.
//!
//! The ranges are wide: they hold for whatever can happen on Earth within a flight, not for what is usual.

use crate::ProtocolError;
use crate::key::Topic;
use crate::message::{Message, Reading};
use std::ops::RangeInclusive;

/// Latitude, degrees.
const LAT_DEG: RangeInclusive<f64> = -90.0..=90.0;
/// Longitude, degrees, however it is wrapped.
const LON_DEG: RangeInclusive<f64> = -360.0..=360.0;
/// Angle, degrees, however it is wrapped.
const ANGLE_DEG: RangeInclusive<f64> = -360.0..=360.0;
/// Altitude above mean sea level, m: below the lowest mine, above the air of the standard atmosphere's first layers.
const ALT_M: RangeInclusive<f64> = -5_000.0..=50_000.0;
/// A component of the wind or of a gust, m/s: the strongest gust ever measured had 113 m/s (Barrow Island 1996).
const WIND_M_S: RangeInclusive<f64> = -150.0..=150.0;
/// Speed of an aircraft, m/s, a component of it or its airspeed: nothing that flies here is faster than sound.
const SPEED_M_S: RangeInclusive<f64> = -400.0..=400.0;
/// Temperature of outside air, K: the coldest air up to 50 km has 130 K, the hottest at the ground 330 K.
const TEMPERATURE_K: RangeInclusive<f64> = 130.0..=400.0;
/// Temperature that a sensor reads, °C: as above, with the warmth of its housing.
const TEMPERATURE_C: RangeInclusive<f64> = -150.0..=200.0;
/// Static pressure, Pa: from that at 50 km to above the highest ever at the lowest shore.
const PRESSURE_PA: RangeInclusive<f64> = 50.0..=120_000.0;
/// Mole fraction, ppm: at most all of the air; what a sensor reads may be off towards either side.
const MOLE_FRACTION_PPM: RangeInclusive<f64> = -1e6..=2e6;
/// Radius of an orbit, m; its sign may tell the sense of rotation.
const RADIUS_M: RangeInclusive<f64> = -100_000.0..=100_000.0;
/// What is a share, or a stick of a remote control.
const SHARE: RangeInclusive<f64> = -1.01..=1.01;
/// Mission time, s: thirty years.
const TIME_S: RangeInclusive<f64> = -1e9..=1e9;

/// Collects the first number that is out of its range.
struct Looks<'a> {
    topic: &'a Topic,
    fault: Option<ProtocolError>,
}

impl Looks<'_> {
    fn at(&mut self, field: &'static str, value: f64, range: RangeInclusive<f64>) {
        if self.fault.is_none() && !range.contains(&value) {
            self.fault = Some(ProtocolError::Implausible {
                key: self.topic.path(),
                field,
                value,
                low: *range.start(),
                high: *range.end(),
            });
        }
    }

    fn all(&mut self, field: &'static str, values: &[f64], range: RangeInclusive<f64>) {
        for value in values {
            self.at(field, *value, range.clone());
        }
    }

    fn place(&mut self, lat_deg: f64, lon_deg: f64, alt_amsl_m: f64) {
        self.at("lat_deg", lat_deg, LAT_DEG);
        self.at("lon_deg", lon_deg, LON_DEG);
        self.at("alt_amsl_m", alt_amsl_m, ALT_M);
    }

    fn reading(&mut self, reading: &Reading) {
        self.place(reading.lat_deg, reading.lon_deg, reading.alt_amsl_m);
        self.at("co2_ppm", reading.co2_ppm, MOLE_FRACTION_PPM);
        let hpa = *PRESSURE_PA.start() / 100.0..=*PRESSURE_PA.end() / 100.0;
        for (field, value, range) in [
            ("wind_speed_m_s", &reading.wind_speed_m_s, WIND_M_S),
            ("wind_from_deg", &reading.wind_from_deg, ANGLE_DEG),
            ("temperature_c", &reading.temperature_c, TEMPERATURE_C),
            ("pressure_hpa", &reading.pressure_hpa, hpa),
        ] {
            self.all(field, value.as_slice(), range);
        }
    }
}

impl Message {
    /// Whether the numbers of a message on `topic` are finite and can be.
    ///
    /// # Errors
    /// [`ProtocolError::Implausible`] with the first that cannot.
    pub fn check_numbers(&self, topic: &Topic) -> Result<(), ProtocolError> {
        let mut looks = Looks { topic, fault: None };
        match self {
            Self::State(m) => {
                looks.place(m.lat_deg, m.lon_deg, m.alt_amsl_m);
                looks.all("vel_ned_m_s", &m.vel_ned_m_s, SPEED_M_S);
                looks.at("roll_deg", m.roll_deg, ANGLE_DEG);
                looks.at("pitch_deg", m.pitch_deg, ANGLE_DEG);
                looks.at("heading_deg", m.heading_deg, ANGLE_DEG);
                looks.at("airspeed_m_s", m.airspeed_m_s, SPEED_M_S);
                looks.at("throttle", m.throttle, SHARE);
            }
            Self::Reading(m) => looks.reading(m),
            Self::Observation(m) => looks.reading(&m.reading),
            Self::Setpoint(m) => {
                looks.place(m.lat_deg, m.lon_deg, m.alt_amsl_m);
                looks.at("airspeed_m_s", m.airspeed_m_s, SPEED_M_S);
                looks.at("orbit_radius_m", m.orbit_radius_m, RADIUS_M);
            }
            Self::Destination(m) => looks.place(m.lat_deg, m.lon_deg, m.alt_amsl_m),
            Self::Control(m) => {
                if let Some(sticks) = m.sticks {
                    looks.at("sticks.roll", sticks.roll, SHARE);
                    looks.at("sticks.pitch", sticks.pitch, SHARE);
                    looks.at("sticks.throttle", sticks.throttle, SHARE);
                }
            }
            Self::Ambient(m) => {
                looks.all("wind_ned_m_s", &m.wind_ned_m_s, WIND_M_S);
                looks.all("gust_ned_m_s", &m.gust_ned_m_s, WIND_M_S);
                looks.at("temperature_k", m.temperature_k, TEMPERATURE_K);
                looks.at("pressure_pa", m.pressure_pa, PRESSURE_PA);
                looks.at("co2_ppm", m.co2_ppm, MOLE_FRACTION_PPM);
                looks.at("ground_amsl_m", m.ground_amsl_m, ALT_M);
            }
            Self::Weather(m) => {
                for row in &m.wind {
                    looks.at("wind.time_s", row.time_s, TIME_S);
                    looks.all("wind.wind_ne_m_s", &row.wind_ne_m_s, WIND_M_S);
                }
            }
            Self::Population(m) => {
                for point in &m.points {
                    looks.place(point.lat_deg, point.lon_deg, point.alt_amsl_m);
                }
            }
            Self::Plan(m) => {
                for to in &m.assignments {
                    looks.place(to.lat_deg, to.lon_deg, to.alt_amsl_m);
                }
            }
            // Words, frames and numbers of messages; and estimates, which may be of any size where little is known.
            Self::Mode(_)
            | Self::Event(_)
            | Self::Mavlink(_)
            | Self::Model(_)
            | Self::Extension(_)
            | Self::Tick(_)
            | Self::Done(_)
            | Self::Swap(_)
            | Self::Health(_) => {}
        }
        looks.fault.map_or(Ok(()), Err)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::key::Name;
    use crate::message::{Ambient, Control, ControlWish, Sticks};

    fn ambient() -> Ambient {
        Ambient {
            wind_ned_m_s: [5.0, -3.0, 0.0],
            gust_ned_m_s: [0.1, 0.0, -0.4],
            temperature_k: 288.15,
            pressure_pa: 92_000.0,
            co2_ppm: 449.0,
            ground_amsl_m: 340.0,
        }
    }

    #[test]
    fn numbers_that_cannot_be_are_named() {
        let topic = Topic::Ambient(Name::new("1").unwrap());
        let said = |change: fn(&mut Ambient)| {
            let mut ambient = ambient();
            change(&mut ambient);
            Message::Ambient(ambient).check_numbers(&topic)
        };
        assert_eq!(said(|_| {}), Ok(()));
        let words = said(|a| a.wind_ned_m_s[1] = 1e300).unwrap_err().to_string();
        assert_eq!(
            words,
            "ws/main/ambient/1: wind_ned_m_s is 1e300; expected -150 to 150"
        );
        assert!(said(|a| a.gust_ned_m_s[2] = f64::NAN).is_err());
        assert!(said(|a| a.temperature_k = 15.0).is_err());
        assert!(said(|a| a.pressure_pa = 0.0).is_err());
        assert!(said(|a| a.ground_amsl_m = f64::INFINITY).is_err());
    }

    #[test]
    fn sticks_are_shares() {
        let topic = Topic::Control(Name::new("1").unwrap());
        let control = |roll| {
            Message::Control(Control {
                wish: ControlWish::TakeOver,
                sticks: Some(Sticks {
                    roll,
                    pitch: 0.0,
                    throttle: 0.5,
                }),
            })
        };
        assert!(control(-1.0).check_numbers(&topic).is_ok());
        assert!(control(f64::NEG_INFINITY).check_numbers(&topic).is_err());
    }
}
