//! The description of a figure that `assets/chart.js` draws: panels with axes, and in each panel layers of lines,
//! points, bars and fields. Reports write it as JSON; the page describes its chart of readings in the same form.

use serde::{Serialize, Serializer};

/// Colours by meaning: what was measured, the model as it was, the model as it is now, and what is true or demanded.
/// Blue and red differ in hue and the grey in lightness, so that every kind of colour vision tells them apart.
pub(crate) const MEASURED: &str = "#d3131f";
pub(crate) const BASE: &str = "#98a2b0";
pub(crate) const MODEL: &str = "#2f6f9f";
pub(crate) const INK: &str = "#16181d";
/// The model's plume and wind on maps, and what stands on a map without being a result.
pub(crate) const OUTLINE: &str = "#8c94a1";

/// Colours that every kind of colour vision tells apart (Okabe and Ito 2008), for platforms, loops and vehicles. Their
/// yellow is omitted, which is faint on white.
const APART: [&str; 7] = [
    "#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00", "#16181d",
];

/// The colour of the `k`-th of several series.
pub(crate) fn colour_of(k: usize) -> &'static str {
    APART[k % APART.len()]
}

/// A figure.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub(crate) struct Figure {
    /// Panels beside each other where the page is wide enough.
    pub(crate) columns: usize,
    /// Panels, row by row.
    pub(crate) panels: Vec<Panel>,
    /// Colours of points that have values.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) scale: Option<ColourScale>,
}

/// Colours by value, with a bar that explains them.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct ColourScale {
    /// What it is of, with its unit.
    pub(crate) title: String,
    /// Values of its ends; values beyond have the colours of these.
    pub(crate) low: f64,
    pub(crate) high: f64,
    /// Places along it, 0 to 1, and their colours as `#rrggbb`.
    pub(crate) colours: Vec<(f64, String)>,
    /// Values that are written below it.
    pub(crate) ticks: Vec<(f64, String)>,
    /// Whether both ends stand out, not the upper one alone.
    pub(crate) both: bool,
}

/// Axes and what is drawn between them.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub(crate) struct Panel {
    /// Written in bold above it, before the name of the upward axis.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub(crate) title: String,
    /// Height between its axes, pixels; of a map its greatest height. A panel with names has the height of these.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) height: Option<u32>,
    /// A metre is as long upwards as across.
    #[serde(skip_serializing_if = "is_false")]
    pub(crate) equal: bool,
    /// Panels of one name have one range across.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) linked: Option<&'static str>,
    /// The wind on a map.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) wind: Option<Wind>,
    /// The axis across.
    pub(crate) x: Axis,
    /// The axis upwards.
    pub(crate) y: Axis,
    /// The lowest first.
    pub(crate) layers: Vec<Layer>,
}

/// An axis. Without further fields its range is that of its values.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub(crate) struct Axis {
    /// What it is of.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub(crate) name: String,
    /// Its unit; empty for a number without.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub(crate) unit: String,
    /// Logarithmic.
    #[serde(skip_serializing_if = "is_false")]
    pub(crate) log: bool,
    /// Its range, whatever the values.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) range: Option<[f64; 2]>,
    /// It goes no further than this; the panel then writes how many values lie beyond.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) limits: Option<[f64; 2]>,
    /// Upward axes of one name have one range.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) shared: Option<&'static str>,
    /// The space below the lowest value does not go below this.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) floor: Option<f64>,
    /// Values that its range has to hold.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(crate) include: Vec<f64>,
    /// Names in place of numbers: the k-th stands at k.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) names: Option<Vec<String>>,
    /// Its numbers stand below another panel, with which it is linked.
    #[serde(skip_serializing_if = "is_false")]
    pub(crate) hidden: bool,
}

impl Axis {
    pub(crate) fn new(name: &str, unit: &str) -> Self {
        Self {
            name: name.to_owned(),
            unit: unit.to_owned(),
            ..Self::default()
        }
    }
}

/// The wind at the corner of a map.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Wind {
    pub(crate) text: String,
    /// Direction in which it blows, degrees clockwise from north.
    pub(crate) towards_deg: f64,
}

/// What is drawn in a panel.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub(crate) enum Layer {
    /// A line through points; broken where a value is not known.
    Line(Line),
    /// The area between two lines.
    Band(Band),
    /// Marks.
    Points(Points),
    /// Bars from zero.
    Bars(Bars),
    /// A grid as shade and contour lines.
    Field(Field),
    /// A dashed line across the whole panel.
    Rule(Rule),
    /// Words at places, left out where they would cover each other.
    Text(Text),
}

/// How a line is drawn.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Dash {
    #[default]
    Solid,
    Dotted,
    Dashed,
    Mixed,
}

/// A line. Layers of one name share an entry of the legend; those without a name have none.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub(crate) struct Line {
    #[serde(skip_serializing_if = "String::is_empty")]
    pub(crate) name: String,
    pub(crate) colour: &'static str,
    pub(crate) width: f64,
    pub(crate) dash: Dash,
    /// It keeps a value until the next one.
    #[serde(skip_serializing_if = "is_false")]
    pub(crate) step: bool,
    /// Its end has an arrowhead.
    #[serde(skip_serializing_if = "is_false")]
    pub(crate) arrow: bool,
    /// A reader who points at it is told nothing.
    #[serde(skip_serializing_if = "is_false")]
    pub(crate) silent: bool,
    pub(crate) x: Column,
    pub(crate) y: Column,
}

/// An area between two lines.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub(crate) struct Band {
    pub(crate) colour: &'static str,
    pub(crate) x: Column,
    pub(crate) low: Column,
    pub(crate) high: Column,
}

/// The shape of a mark.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Symbol {
    #[default]
    Dot,
    Diamond,
    Square,
    Ring,
    Cross,
    /// An upright line, for a median in a row of dots.
    Bar,
}

/// Marks.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub(crate) struct Points {
    #[serde(skip_serializing_if = "String::is_empty")]
    pub(crate) name: String,
    /// One colour for all; without, they have the colours of `values`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) colour: Option<&'static str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) values: Option<Column>,
    pub(crate) symbol: Symbol,
    /// Width, pixels.
    pub(crate) size: f64,
    /// Further width of a value at the upper end of the colours, pixels.
    #[serde(skip_serializing_if = "is_zero")]
    pub(crate) grow: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) opacity: Option<f64>,
    #[serde(skip_serializing_if = "is_false")]
    pub(crate) silent: bool,
    pub(crate) x: Column,
    pub(crate) y: Column,
    /// An interval of each, along one axis.
    #[serde(flatten)]
    pub(crate) interval: Option<Interval>,
    /// What a reader who points at a mark is told besides its place.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(crate) details: Vec<Detail>,
}

/// Intervals of marks or bars.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Interval {
    /// `x` or `y`.
    pub(crate) along: &'static str,
    pub(crate) low: Column,
    pub(crate) high: Column,
}

/// A further value of each mark.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub(crate) struct Detail {
    pub(crate) name: String,
    #[serde(skip_serializing_if = "String::is_empty")]
    pub(crate) unit: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) values: Option<Column>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) texts: Option<Vec<String>>,
}

/// Bars from zero.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub(crate) struct Bars {
    #[serde(skip_serializing_if = "String::is_empty")]
    pub(crate) name: String,
    pub(crate) colour: &'static str,
    /// A colour each.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) colours: Option<Vec<&'static str>>,
    #[serde(skip_serializing_if = "is_false")]
    pub(crate) horizontal: bool,
    /// Which of how many bars beside each other this is.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) slot: Option<[usize; 2]>,
    /// Widths in units of the axis; without, most of the space between two names.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) widths: Option<Column>,
    pub(crate) x: Column,
    pub(crate) y: Column,
    /// Written at the end of each.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) texts: Option<Vec<String>>,
}

/// A grid of values above background.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Field {
    #[serde(skip_serializing_if = "String::is_empty")]
    pub(crate) name: String,
    pub(crate) grid: FieldGrid,
    /// Row by row from below.
    pub(crate) values: Column,
    /// The value at which the shade is nearly darkest; without, there is no shade.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) darkest: Option<f64>,
    /// Values with a contour line, and what is written on it.
    pub(crate) levels: Vec<(f64, String)>,
    /// Of the contour lines.
    pub(crate) colour: &'static str,
    pub(crate) dash: Dash,
}

/// Where the cells of a grid are.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(crate) struct FieldGrid {
    /// Place of the first cell.
    pub(crate) x: f64,
    pub(crate) y: f64,
    /// Between cells, along both axes.
    pub(crate) step: f64,
    /// Between rows, where that differs.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) up: Option<f64>,
    pub(crate) columns: usize,
    pub(crate) rows: usize,
}

/// A dashed line at a value.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub(crate) struct Rule {
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) x: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) y: Option<f64>,
}

/// Words at places, the most important first.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub(crate) struct Text {
    pub(crate) x: Column,
    pub(crate) y: Column,
    pub(crate) texts: Vec<String>,
}

/// Numbers, rounded for a smaller file; what is not finite is null.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Column {
    values: Vec<f64>,
    per_unit: f64,
}

impl Column {
    /// Numbers in steps of one over `per_unit`.
    pub(crate) fn new(values: impl IntoIterator<Item = f64>, per_unit: f64) -> Self {
        Self {
            values: values.into_iter().collect(),
            per_unit,
        }
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.values.is_empty()
    }

    /// The same with a gap before each of the `breaks`, where a line ends and begins anew.
    pub(crate) fn broken(mut self, breaks: &[usize]) -> Self {
        let values = std::mem::take(&mut self.values).into_iter().enumerate();
        for (i, value) in values {
            if breaks.binary_search(&i).is_ok() {
                self.values.push(f64::NAN);
            }
            self.values.push(value);
        }
        self
    }
}

impl Serialize for Column {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(self.values.iter().map(|v| Rounded::new(*v, self.per_unit)))
    }
}

/// A number in JSON with no more digits than it needs.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(untagged)]
pub(crate) enum Rounded {
    Whole(i64),
    Number(f64),
    Unknown(()),
}

impl Rounded {
    pub(crate) fn new(value: f64, per_unit: f64) -> Self {
        /// Up to here every whole number is a float of its own.
        const WHOLE: f64 = 9e15;
        let value = (value * per_unit).round() / per_unit;
        match value {
            v if !v.is_finite() => Self::Unknown(()),
            v if v.fract() == 0.0 && v.abs() < WHOLE => Self::Whole(v as i64),
            v => Self::Number(v),
        }
    }
}

#[expect(
    clippy::trivially_copy_pass_by_ref,
    reason = "serde asks with a reference"
)]
fn is_false(value: &bool) -> bool {
    !value
}

#[expect(
    clippy::trivially_copy_pass_by_ref,
    reason = "serde asks with a reference"
)]
fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

/// Values with their intervals, a row each: name, value, low and high.
pub(crate) fn intervals((name, unit): (&str, &str), rows: &[(String, [f64; 3])]) -> Figure {
    let column = |k: usize| Column::new(rows.iter().map(|(_, values)| values[k]), 1e6);
    let points = Points {
        colour: Some(MODEL),
        size: 9.0,
        x: column(0),
        y: Column::new((0..rows.len()).map(|k| k as f64), 1.0),
        interval: Some(Interval {
            along: "x",
            low: column(1),
            high: column(2),
        }),
        ..Points::default()
    };
    let panel = Panel {
        x: Axis {
            include: vec![0.0],
            ..Axis::new(name, unit)
        },
        y: Axis {
            names: Some(rows.iter().map(|row| row.0.clone()).collect()),
            ..Axis::default()
        },
        layers: vec![Layer::Points(points)],
        ..Panel::default()
    };
    Figure {
        columns: 1,
        panels: vec![panel],
        scale: None,
    }
}

/// The interval at which to take items so that at most about `most` of `count` are left.
pub(crate) fn stride(count: usize, most: usize) -> usize {
    count.div_ceil(most.max(1)).max(1)
}

/// A line is broken where nothing was read for so many of the usual steps between two readings: over a pause it
/// would show values without readings.
const STEPS_OF_A_PAUSE: f64 = 20.0;

/// Where a line over `time_s` has to be broken: the indices of what follows a pause.
pub(crate) fn pauses(time_s: &[f64]) -> Vec<usize> {
    let mut steps: Vec<f64> = time_s.windows(2).map(|t| t[1] - t[0]).collect();
    if steps.is_empty() {
        return Vec::new();
    }
    steps.sort_by(f64::total_cmp);
    let longest = STEPS_OF_A_PAUSE * steps[steps.len() / 2];
    let after_a_pause = |&i: &usize| time_s[i] - time_s[i - 1] > longest;
    (1..time_s.len()).filter(after_a_pause).collect()
}

/// From here on an axis of time has hours, s: numbers of seconds with five digits and more say nothing to a reader.
const HOURS_FROM_S: f64 = 3.0 * 3600.0;

/// The unit of an axis that spans so many seconds, and how many seconds it has.
pub(crate) fn unit_of_time(span_s: f64) -> (&'static str, f64) {
    if span_s > HOURS_FROM_S {
        ("h", 3600.0)
    } else {
        ("s", 1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short_and_what_is_not_known_is_null() {
        let column = Column::new([1.0, 1.234_56, -0.000_1, f64::NAN, 1e300], 100.0);
        let json = serde_json::to_string(&column).unwrap();
        assert_eq!(json, "[1,1.23,0,null,1e+300]");
        let broken = Column::new([1.0, 2.0, 3.0], 1.0).broken(&[1]);
        assert_eq!(serde_json::to_string(&broken).unwrap(), "[1,null,2,3]");
    }

    #[test]
    fn a_layer_says_what_it_is_and_nothing_that_is_not_so() {
        let layer = Layer::Line(Line {
            colour: INK,
            width: 1.0,
            x: Column::new([0.0, 1.0], 1.0),
            y: Column::new([2.0, 3.0], 1.0),
            ..Line::default()
        });
        let json = serde_json::to_value(layer).unwrap();
        let expected = serde_json::json!({"kind": "line", "colour": "#16181d", "width": 1.0, "dash": "solid", "x": [0, 1], "y": [2, 3]});
        assert_eq!(json, expected);
    }
}
