//! ArduPilot's `.waypoints`: a table of mission items, "QGC WPL 110" (MAVLink, *Plain-Text File Formats*).

use super::{FlightPlan, Heights, STOP_S};
use std::fmt::Write as _;

/// MAV_FRAME: above mean sea level, above home.
const AMSL: u8 = 0;
const ABOVE_HOME: u8 = 3;

/// The text of the file.
pub(super) fn encode(plan: &FlightPlan, heights: Heights) -> String {
    let frame = match heights {
        Heights::TakeOff => ABOVE_HOME,
        Heights::Amsl => AMSL,
    };
    let (lat, lon, ground) = plan.home;
    let mut out = "QGC WPL 110\n".to_owned();
    let mut number = 0;
    let mut item = |frame: u8, command: u16, params: [f64; 4], (lat, lon, alt): (f64, f64, f64)| {
        let current = u8::from(number == 0);
        let [a, b, c, d] = params;
        let _ = writeln!(
            out,
            "{number}\t{current}\t{frame}\t{command}\t{a:.6}\t{b:.6}\t{c:.6}\t{d:.6}\t{lat:.8}\t{lon:.8}\t{alt:.6}\t1"
        );
        number += 1;
    };
    // Item 0 is home.
    item(AMSL, 16, [0.0; 4], (lat, lon, ground));
    let up = plan.height_m(ground + plan.take_off_height_m, heights);
    item(frame, 22, [0.0; 4], (lat, lon, up));
    // 1: speed over ground; of a fixed wing 0: airspeed.
    let kind = f64::from(u8::from(plan.multirotor));
    item(
        ABOVE_HOME,
        178,
        [kind, plan.speed_m_s, -1.0, 0.0],
        (0.0, 0.0, 0.0),
    );
    for point in &plan.points {
        let wait_s = if point.stops { STOP_S } else { 0.0 };
        let height = plan.height_m(point.alt_amsl_m, heights);
        item(
            frame,
            16,
            [wait_s, 0.0, 0.0, 0.0],
            (point.lat_deg, point.lon_deg, height),
        );
    }
    item(ABOVE_HOME, 20, [0.0; 4], (0.0, 0.0, 0.0));
    out
}

#[cfg(test)]
mod tests {
    use super::super::tests::plan;
    use super::*;

    #[test]
    fn each_item_has_twelve_columns() {
        let text = encode(&plan(), Heights::TakeOff);
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines[0], "QGC WPL 110");
        assert_eq!(lines.len(), 8);
        assert!(lines[1..].iter().all(|l| l.split('\t').count() == 12));
        assert_eq!(
            lines[4],
            "3\t0\t3\t16\t2.000000\t0.000000\t0.000000\t0.000000\t43.44000000\t-7.86000000\t30.000000\t1"
        );
        let amsl = encode(&plan(), Heights::Amsl);
        assert!(amsl.contains("\t0\t16\t2.000000\t0.000000\t0.000000\t0.000000\t43.44000000\t-7.86000000\t370.000000\t1"));
    }
}
