//! Raster tiles under the map, loaded by the browser from where somebody says.

use std::str::FromStr;

/// A template of addresses of raster tiles (web mercator, 256 pixels), such as
/// `https://tile.openstreetmap.org/{z}/{x}/{y}.png`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Tiles {
    template: String,
    /// Length of its scheme and host.
    origin: usize,
}

impl Tiles {
    /// The template.
    pub fn template(&self) -> &str {
        &self.template
    }

    /// Scheme, host and port, which the page lets the browser load pictures from.
    pub(crate) fn origin(&self) -> &str {
        self.template.get(..self.origin).unwrap_or_default()
    }
}

impl FromStr for Tiles {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let refused = |what: &str| {
            Err(format!(
                "{what}: expected an address with {{z}}, {{x}} and {{y}}, such as \
                 https://tile.openstreetmap.org/{{z}}/{{x}}/{{y}}.png"
            ))
        };
        let Some((scheme, rest)) = text.split_once("://") else {
            return refused("no address");
        };
        if !matches!(scheme, "http" | "https") {
            return refused("neither http nor https");
        }
        if let Some(missing) = ["{z}", "{x}", "{y}"].iter().find(|p| !rest.contains(*p)) {
            return refused(&format!("{missing} is missing"));
        }
        let host = rest.find('/').unwrap_or(rest.len());
        // It goes into a header, in which these would begin something else.
        let plain = |c: char| c.is_ascii_alphanumeric() || matches!(c, '.' | '-' | ':' | '[' | ']');
        if host == 0 || !rest.chars().take(host).all(plain) {
            return refused("no host");
        }
        Ok(Self {
            template: text.to_owned(),
            origin: scheme.len() + 3 + host,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_template_says_where_it_is_from_and_others_are_refused() {
        let tiles: Tiles = "https://tiles.example:444/a/{z}/{x}/{y}.png?key=1"
            .parse()
            .unwrap();
        assert_eq!(tiles.origin(), "https://tiles.example:444");
        for (text, why) in [
            ("tiles/{z}/{x}/{y}.png", "no address"),
            ("ftp://tiles.example/{z}/{x}/{y}", "neither http nor https"),
            ("https://tiles.example/{z}/{x}.png", "{y} is missing"),
            ("https:///{z}/{x}/{y}", "no host"),
            ("https://a; script-src */{z}/{x}/{y}", "no host"),
        ] {
            let refused = text.parse::<Tiles>().unwrap_err();
            assert!(refused.starts_with(why), "{text}: {refused}");
        }
    }
}
