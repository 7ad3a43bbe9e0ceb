//! Flight patterns of aircraft that can stop: what `search.pattern` and `plumage plan --pattern` name.

use serde::{Deserialize, Deserializer, Serialize};

/// A flight pattern around or downwind of a source.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Pattern {
    /// Level transects across the wind, one above the other, at one distance downwind.
    Curtain,
    /// Straight up through the plume on its axis, with stops.
    Profile,
    /// Around the stack, rising.
    Spiral,
    /// Level transects across the wind at the plume's height, at several distances.
    Transects,
}

impl Pattern {
    /// All patterns.
    pub const ALL: [Self; 4] = [Self::Curtain, Self::Profile, Self::Spiral, Self::Transects];

    /// Its name in files and on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Curtain => "curtain",
            Self::Profile => "profile",
            Self::Spiral => "spiral",
            Self::Transects => "transects",
        }
    }
}

impl std::fmt::Display for Pattern {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

impl std::str::FromStr for Pattern {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        let known = Self::ALL.into_iter().find(|p| p.name() == name);
        known.ok_or_else(|| {
            let names = Self::ALL.map(Self::name).join(", ");
            format!("'{name}' is no pattern; expected one of {names}")
        })
    }
}

/// One pattern, or several that are flown one after the other.
pub(crate) fn one_or_several<'de, D: Deserializer<'de>>(
    deserializer: D,
) -> Result<Vec<Pattern>, D::Error> {
    #[derive(Deserialize)]
    #[serde(
        untagged,
        expecting = "a pattern (curtain, profile, spiral or transects) or a list of them"
    )]
    enum OneOrSeveral {
        One(Pattern),
        Several(Vec<Pattern>),
    }
    Ok(match OneOrSeveral::deserialize(deserializer)? {
        OneOrSeveral::One(pattern) => vec![pattern],
        OneOrSeveral::Several(patterns) => patterns,
    })
}
