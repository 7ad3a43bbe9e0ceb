//! Wind in the surface layer by similarity theory: log-linear in stable air, Businger–Dyer in
//! unstable air (Dyer 1974; Paulson 1970; Webb 1970 beyond z = L).

use super::arcs::Weather;

/// The integrated stability function ψ_m of height over Obukhov length.
fn psi(zeta: f64) -> f64 {
    if zeta < 0.0 {
        let x = (1.0 - 16.0 * zeta).powf(0.25);
        2.0 * ((1.0 + x) / 2.0).ln() + ((1.0 + x * x) / 2.0).ln() - 2.0 * x.atan()
            + std::f64::consts::FRAC_PI_2
    } else if zeta < 1.0 {
        -5.0 * zeta
    } else {
        -5.0 * (1.0 + zeta.ln())
    }
}

/// Wind speed at `height_m` above ground, m/s: the profile's shape through the measured wind.
/// Heights below ten roughness lengths take the wind of that height.
pub fn wind_speed_m_s(weather: &Weather, height_m: f64) -> f64 {
    let (z0, length) = (weather.roughness_m, weather.obukhov_length_m);
    let shape = |z: f64| {
        let z = z.max(10.0 * z0);
        (z / z0).ln() - psi(z / length) + psi(z0 / length)
    };
    weather.wind_speed_m_s * shape(height_m) / shape(weather.wind_height_m)
}

#[cfg(test)]
mod tests {
    use super::*;
    use plume::stability::Stability;

    fn weather(obukhov_length_m: f64) -> Weather {
        Weather {
            trial: "t".into(),
            release_mg_s: 1.0,
            source_height_m: 0.5,
            wind_speed_m_s: 5.0,
            wind_height_m: 2.0,
            obukhov_length_m,
            roughness_m: 0.006,
            mixing_height_m: None,
            sigma_azimuth_rad: None,
            wind_from_deg: None,
            class: Stability::D,
            class_position: 3.0,
        }
    }

    // By hand: neutral u(10)/u(2) = ln(10/.006)/ln(2/.006) = 7.41858/5.80914.
    // ψ(-1), Paulson (1970): x = 17^(1/4), 2 ln 1.515272 + ln 2.561553 - 2 atan 2.030543 + π/2.
    #[test]
    fn profiles_by_hand() {
        let ratio = wind_speed_m_s(&weather(1e9), 10.0) / 5.0;
        assert!((ratio - 7.418_58 / 5.809_14).abs() < 1e-4, "{ratio}");
        assert!((psi(-1.0) - 1.116_230).abs() < 1e-4, "{}", psi(-1.0));
        assert!((psi(1.0 + 1e-9) - psi(1.0 - 1e-9)).abs() < 1e-6);
    }

    #[test]
    fn stable_air_shears_more_than_unstable() {
        let at = |l: f64| wind_speed_m_s(&weather(l), 20.0);
        assert!(at(20.0) > at(1e9) && at(1e9) > at(-20.0) && at(-20.0) > 5.0);
    }
}
