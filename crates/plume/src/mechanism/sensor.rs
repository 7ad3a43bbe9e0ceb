//! The sensor, its clock and its logged place; these may differ between platforms.

use super::entry::{Action, Family, MechanismSpec, Steps, factor, limit, offset, setting};
use crate::effects::HOUR_S;

pub(super) const LAG: MechanismSpec = MechanismSpec {
    name: "sensor-lag",
    family: Family::Sensor,
    parameters: &[offset("time_constant_s", "s", 8.0, 0.0, 600.0)],
    sign: "first-order time constant, in series with the sensor's own",
    action: Action::OnSensor(|e, v| {
        if v[0] > 0.0 {
            e.lags_s.push(v[0]);
        }
    }),
    steps: Steps::Line(&[0.6, 3.0, 10.0]),
    check: Some("response time of the sensor to a step of gas on the ground"),
};

pub(super) const GAIN: MechanismSpec = MechanismSpec {
    name: "sensor-gain",
    family: Family::Sensor,
    parameters: &[
        factor("factor", 0.2, 0.01, 100.0),
        setting("pivot_ppm", "ppm", 0.0, -1e5, 1e6),
    ],
    sign: "reading = pivot + factor times (concentration - pivot)",
    action: Action::OnSensor(|e, v| {
        e.gain *= v[0];
        e.offset_ppm = v[1] + v[0] * (e.offset_ppm - v[1]);
    }),
    steps: Steps::AboutBackground(1.05),
    check: Some("readings of the sensors in span gas on the ground"),
};

pub(super) const OFFSET: MechanismSpec = MechanismSpec {
    name: "sensor-offset",
    family: Family::Sensor,
    parameters: &[offset("offset_ppm", "ppm", 10.0, -1e4, 1e4)],
    sign: "added to the reading",
    action: Action::OnSensor(|e, v| e.offset_ppm += v[0]),
    steps: Steps::Line(&[1.0]),
    check: Some("readings of the sensors in zero gas on the ground"),
};

pub(super) const DRIFT: MechanismSpec = MechanismSpec {
    name: "sensor-drift",
    family: Family::Sensor,
    parameters: &[offset("rate_ppm_per_h", "ppm/h", 20.0, -1e4, 1e4)],
    sign: "added to the reading: rate times hours since time 0",
    action: Action::OnSensor(|e, v| e.drift_ppm_s += v[0] / HOUR_S),
    steps: Steps::Line(&[10.0]),
    check: Some("readings of the sensors in zero gas before and after the flight"),
};

pub(super) const SATURATION: MechanismSpec = MechanismSpec {
    name: "sensor-saturation",
    family: Family::Sensor,
    parameters: &[limit("limit_ppm", "ppm", 800.0, 1e-6, 1e6)],
    sign: "no reading above this limit",
    action: Action::OnSensor(|e, v| e.limit_ppm = e.limit_ppm.min(v[0])),
    steps: Steps::PartsOfRange,
    check: Some("readings of the sensors in span gas on the ground"),
};

pub(super) const CROSS_SENSITIVITY_HUMIDITY: MechanismSpec = MechanismSpec {
    name: "cross-sensitivity-humidity",
    family: Family::Sensor,
    parameters: &[
        offset("ppm_per_percent", "ppm/%", 0.5, -100.0, 100.0),
        setting("reference_percent", "%", 50.0, 0.0, 100.0),
    ],
    sign: "added to the reading: coefficient times (relative humidity - reference)",
    action: Action::OnSensor(|e, v| join(&mut e.humidity, v)),
    steps: Steps::Line(&[0.2]),
    check: Some("readings of the sensors in zero gas of different temperature and humidity"),
};

pub(super) const CROSS_SENSITIVITY_TEMPERATURE: MechanismSpec = MechanismSpec {
    name: "cross-sensitivity-temperature",
    family: Family::Sensor,
    parameters: &[
        offset("ppm_per_k", "ppm/K", 1.0, -100.0, 100.0),
        setting("reference_c", "deg C", 15.0, -60.0, 60.0),
    ],
    sign: "added to the reading: coefficient times (air temperature - reference)",
    action: Action::OnSensor(|e, v| join(&mut e.temperature, v)),
    steps: Steps::Line(&[0.5]),
    check: Some("readings of the sensors in zero gas of different temperature and humidity"),
};

pub(super) const CROSS_SENSITIVITY_PRESSURE: MechanismSpec = MechanismSpec {
    name: "cross-sensitivity-pressure",
    family: Family::Sensor,
    parameters: &[
        offset("ppm_per_hpa", "ppm/hPa", 0.5, -100.0, 100.0),
        setting("reference_hpa", "hPa", 1013.25, 100.0, 1100.0),
    ],
    sign: "added to the reading: coefficient times (pressure - reference)",
    action: Action::OnSensor(|e, v| join(&mut e.pressure, v)),
    steps: Steps::AboutPressureMet(0.2),
    check: Some("readings of the sensors in zero gas at the pressures of the flight"),
};

pub(super) const CLOCK_OFFSET: MechanismSpec = MechanismSpec {
    name: "clock-offset",
    family: Family::Sensor,
    parameters: &[offset("offset_s", "s", 5.0, -600.0, 600.0)],
    sign: "logged time of a reading = true time + offset, against the clock of the positions",
    action: Action::OnSensor(|e, v| e.clock_s += v[0]),
    steps: Steps::Line(&[0.3, -3.0, 3.0]),
    check: Some("comparison of the aircraft's clock with that of its position fixes"),
};

pub(super) const POSITION_OFFSET: MechanismSpec = MechanismSpec {
    name: "position-offset",
    family: Family::Sensor,
    parameters: &[
        offset("east_m", "m", 20.0, -5000.0, 5000.0),
        offset("north_m", "m", 20.0, -5000.0, 5000.0),
    ],
    sign: "logged position = true position + offset",
    action: Action::OnSensor(|e, v| {
        e.position_m[0] += v[0];
        e.position_m[1] += v[1];
    }),
    steps: Steps::Plane(5.0),
    check: Some("a position log of the aircraft on a surveyed point"),
};

pub(super) const ALTITUDE_OFFSET: MechanismSpec = MechanismSpec {
    name: "altitude-offset",
    family: Family::Sensor,
    parameters: &[offset("offset_m", "m", 20.0, -1000.0, 1000.0)],
    sign: "logged altitude = true altitude + offset",
    action: Action::OnSensor(|e, v| e.position_m[2] += v[0]),
    steps: Steps::Line(&[2.0, -20.0, 20.0]),
    check: Some("an altitude log of the aircraft on a surveyed point"),
};

/// Two linear terms k1 (x - r1) + k2 (x - r2) as one.
fn join(sum: &mut [f64; 2], v: &[f64]) {
    let slope = sum[0] + v[0];
    // Slopes that cancel leave a constant, which this form cannot hold: the last reference stays.
    if slope != 0.0 {
        sum[1] = (sum[0] * sum[1] + v[0] * v[1]) / slope;
    }
    sum[0] = slope;
}

#[cfg(test)]
mod tests {
    use crate::effects::{SensorAir, SensorEffects};
    use crate::mechanism::Mechanism;

    #[test]
    fn gain_turns_about_its_pivot() {
        let gain = Mechanism::new("sensor-gain", &[("factor", 1.1), ("pivot_ppm", 450.0)]).unwrap();
        let e = SensorEffects::none().with(&[gain], "1");
        assert!((e.gain * 450.0 + e.offset_ppm - 450.0).abs() < 1e-9);
        assert!((e.gain * 550.0 + e.offset_ppm - 560.0).abs() < 1e-9);
    }

    #[test]
    fn cross_sensitivities_join() {
        let of = |k, r| {
            Mechanism::new(
                "cross-sensitivity-humidity",
                &[("ppm_per_percent", k), ("reference_percent", r)],
            )
            .unwrap()
        };
        let e = SensorEffects::none().with(&[of(0.2, 50.0), of(0.3, 40.0)], "1");
        let air = SensorAir {
            relative_humidity_pct: 70.0,
            ..SensorAir::UNKNOWN
        };
        assert!((e.cross_ppm(&air) - (0.2 * 20.0 + 0.3 * 30.0)).abs() < 1e-12);
        assert_eq!(e.cross_ppm(&SensorAir::UNKNOWN), 0.0);
    }
}
