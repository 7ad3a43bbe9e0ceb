//! An aircraft file with other gains, everything else as it was.

use crate::aircraft::{Aircraft, ControlGains};
use crate::error::FdmError;

/// The text of an aircraft file with its `[control]` table replaced; comments elsewhere stay.
/// `file_name` is for messages only.
///
/// # Errors
/// As [`Aircraft::from_toml`] for the text given; [`FdmError::Unwritable`] when gains have no TOML
/// form (none of a checked set).
pub fn with_gains(file_name: &str, text: &str, gains: &ControlGains) -> Result<String, FdmError> {
    let mut aircraft = Aircraft::from_toml(file_name, text)?;
    aircraft.control = *gains;
    let table = toml::to_string(gains).map_err(|error| FdmError::Unwritable(error.to_string()))?;
    let mut kept = String::with_capacity(text.len() + table.len());
    let (mut inside, mut written) = (false, false);
    let own = format!("[control]\n{table}\n");
    for line in text.lines() {
        let header = line.trim_start();
        if header.starts_with('[') {
            inside = header.starts_with("[control]");
            // Arrays of tables come last in a file, and single tables before them.
            if !written && (inside || header.starts_with("[[")) {
                kept.push_str(&own);
                written = true;
            }
        }
        if !inside {
            kept.push_str(line);
            kept.push('\n');
        }
    }
    if !written {
        kept = format!("{}\n\n{own}", kept.trim_end());
    }
    // A way of writing that the lines above do not understand: the whole file anew.
    match Aircraft::from_toml(file_name, &kept) {
        Ok(read) if read == aircraft => Ok(kept),
        _ => aircraft.to_toml(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_gains_change_and_comments_stay() {
        let gains = ControlGains {
            roll_bandwidth_rad_s: 5.25,
            ..ControlGains::default()
        };
        let x8 = include_str!("../../../../aircraft/x8.toml");
        let stick = include_str!("../../../../aircraft/ultrastick-25e.toml");
        let extended = format!("{stick}\n[[mechanism]]\nid = \"roll-damping\"\nfactor = 2.0\n");
        let inline = x8.replacen("name =", "control = {orbit_gain = 2.0}\nname =", 1);
        for (text, comments) in [
            (x8, true),
            (stick, true),
            (&extended, true),
            (&inline, false),
        ] {
            let new = with_gains("aircraft.toml", text, &gains).unwrap();
            let mut expected = Aircraft::from_toml("before", text).unwrap();
            expected.control = gains;
            assert_eq!(Aircraft::from_toml("after", &new).unwrap(), expected);
            assert_eq!(new.starts_with('#'), comments, "{new}");
            // Once more changes nothing.
            let again = with_gains("aircraft.toml", &new, &gains).unwrap();
            assert_eq!(again.trim_end(), new.trim_end());
        }
    }
}
