//! The colours of readings: one scale for the KML tracks, the report and the page.

/// At and below this reading the colour is grey, ppm.
pub const GREY_PPM: f64 = 450.0;
/// At and above this reading the colour is red, ppm.
pub const RED_PPM: f64 = 840.0;

/// Colours at equal steps from [`GREY_PPM`] to [`RED_PPM`]: grey, ochre, orange, red. From ochre
/// on they darken, so that their order is seen without hue.
const STOPS: [[u8; 3]; 5] = [
    [158, 163, 170],
    [214, 178, 94],
    [238, 139, 48],
    [227, 79, 38],
    [190, 10, 38],
];

/// The colour of a reading of CO2 in ppm, as red, green, blue. What is not finite is grey.
pub(crate) fn of_reading(co2_ppm: f64) -> [u8; 3] {
    let along = (co2_ppm - GREY_PPM) / (RED_PPM - GREY_PPM);
    let along = if along.is_finite() {
        along.clamp(0.0, 1.0)
    } else {
        0.0
    };
    let scaled = along * (STOPS.len() - 1) as f64;
    let from = (scaled as usize).min(STOPS.len() - 2);
    let rest = scaled - from as f64;
    std::array::from_fn(|channel| {
        let (a, b) = (STOPS[from][channel], STOPS[from + 1][channel]);
        (f64::from(a) + rest * (f64::from(b) - f64::from(a))).round() as u8
    })
}

/// The scale as stops for plotting libraries: position from 0 to 1 and `#rrggbb`.
pub fn stops() -> Vec<(f64, String)> {
    STOPS
        .iter()
        .enumerate()
        .map(|(i, [r, g, b])| {
            let at = i as f64 / (STOPS.len() - 1) as f64;
            (at, format!("#{r:02x}{g:02x}{b:02x}"))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ends_and_beyond() {
        assert_eq!(of_reading(449.0), of_reading(GREY_PPM));
        assert_eq!(of_reading(2000.0), of_reading(RED_PPM));
        assert_eq!(of_reading(f64::NAN), of_reading(GREY_PPM));
        let [r, g, b] = of_reading(RED_PPM);
        assert!(r > 3 * g && r > 3 * b, "the top of the scale is red");
        let [r, g, b] = of_reading(GREY_PPM);
        assert!(r.abs_diff(g) < 20 && g.abs_diff(b) < 20, "its foot is grey");
    }

    #[test]
    fn from_the_second_stop_more_is_darker() {
        // Rec. 709 luma; steps of 10 ppm are wider than the rounding to bytes.
        let luma = |ppm: f64| {
            let [r, g, b] = of_reading(ppm).map(f64::from);
            0.2126 * r + 0.7152 * g + 0.0722 * b
        };
        for step in 0..29 {
            let ppm = 550.0 + 10.0 * f64::from(step);
            assert!(luma(ppm) > luma(ppm + 10.0), "{ppm}");
        }
    }
}
