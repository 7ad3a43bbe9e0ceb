//! The columns of the nameless terms: hats and waves in time, place and across the plume.

use super::fit::{Context, Fitted};

/// What a term multiplies.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Load {
    /// Nothing: it adds to the reading.
    Additive,
    /// The plume's part of the reading.
    Proportional,
    /// The derivative by wind direction: it moves the plume.
    Swing,
    /// The derivative by time: it shifts the reading in time.
    Delay,
}

/// A flexible term.
#[derive(Debug, Clone)]
pub(crate) struct Term {
    pub coordinate: &'static str,
    pub words: String,
    pub platform: Option<usize>,
    /// Log of its share of the rivals' prior.
    pub ln_weight: f64,
    /// Positions of its columns.
    pub columns: std::ops::Range<usize>,
}

/// Columns as they are made, before whitening.
struct Builder<'a> {
    ctx: &'a Context<'a>,
    fitted: &'a Fitted,
    delay: Vec<f64>,
    columns: Vec<Vec<f64>>,
    terms: Vec<Term>,
}

impl<'a> Builder<'a> {
    fn load(&self, load: Load, i: usize) -> f64 {
        match load {
            Load::Additive => 1.0,
            Load::Proportional => self.fitted.loading[i].gust,
            Load::Swing => self.fitted.loading[i].swing,
            Load::Delay => self.delay[i],
        }
    }

    /// Time at each row less this part of the plume's time on its way there, s: at 1 the time of
    /// emission, at 0.5 that of the wind which turned it most.
    fn time_on_the_way(&self, part: f64) -> Vec<f64> {
        let times = self.ctx.data.track.time_s();
        self.ctx
            .way_s()
            .zip(times)
            .map(|(way_s, t)| t - part * way_s)
            .collect()
    }

    /// Hat functions over `at` (one value a row) times the load.
    fn hats(&mut self, at: &[f64], knots: usize, load: Load) -> std::ops::Range<usize> {
        let start = self.columns.len();
        let knots = self.knots(at, knots, load);
        if knots.len() < 2 {
            return start..start;
        }
        let mut columns = vec![vec![0.0; at.len()]; knots.len()];
        for (i, u) in at.iter().enumerate() {
            let load = self.load(load, i);
            let k = knots.partition_point(|x| x <= u).clamp(1, knots.len() - 1);
            let part = ((u - knots[k - 1]) / (knots[k] - knots[k - 1])).clamp(0.0, 1.0);
            columns[k - 1][i] = (1.0 - part) * load;
            columns[k][i] = part * load;
        }
        self.columns.extend(columns);
        start..self.columns.len()
    }

    /// Knots at even shares of the information that the load gives.
    fn knots(&self, at: &[f64], count: usize, load: Load) -> Vec<f64> {
        let mut order: Vec<usize> = (0..at.len()).filter(|i| self.ctx.data.used[*i]).collect();
        order.sort_by(|a, b| at[*a].total_cmp(&at[*b]));
        let total: f64 = order.iter().map(|i| self.load(load, *i).powi(2)).sum();
        if total <= 0.0 || order.is_empty() {
            return Vec::new();
        }
        let (mut sum, mut out) = (0.0, Vec::with_capacity(count));
        for i in order {
            let due = total * out.len() as f64 / (count - 1) as f64;
            sum += self.load(load, i).powi(2);
            if sum > due && out.len() < count {
                out.push(at[i]);
            }
        }
        out.dedup_by(|b, a| *b - *a < 1e-6);
        out
    }

    fn add(&mut self, coordinate: &'static str, words: &str, columns: std::ops::Range<usize>) {
        self.add_weighted(coordinate, words.to_string(), None, 0.0, columns);
    }

    fn add_weighted(
        &mut self,
        coordinate: &'static str,
        words: String,
        platform: Option<usize>,
        ln_weight: f64,
        columns: std::ops::Range<usize>,
    ) {
        if !columns.is_empty() {
            self.terms.push(Term {
                coordinate,
                words,
                platform,
                ln_weight,
                columns,
            });
        }
    }
}

/// All columns on top of `fitted`, before whitening, and the terms that they belong to.
pub(crate) fn all(ctx: &Context<'_>, fitted: &Fitted) -> (Vec<Vec<f64>>, Vec<Term>) {
    let mut b = Builder {
        ctx,
        fitted,
        delay: rate_of_change(ctx, fitted),
        columns: Vec::new(),
        terms: Vec::new(),
    };
    in_time(&mut b);
    in_place(&mut b);
    periodic(&mut b);
    (b.columns, b.terms)
}

/// Derivative of the predicted reading by time on each platform.
fn rate_of_change(ctx: &Context<'_>, fitted: &Fitted) -> Vec<f64> {
    let times = ctx.data.track.time_s();
    let r = &fitted.prediction.reading;
    let mut out = vec![0.0; r.len()];
    for range in ctx.data.ranges() {
        for i in range.clone() {
            let (a, b) = (i.max(range.start + 1) - 1, (i + 1).min(range.end - 1));
            if times[b] > times[a] {
                out[i] = (r[b] - r[a]) / (times[b] - times[a]);
            }
        }
    }
    out
}

fn in_time(b: &mut Builder<'_>) {
    let time = b.ctx.data.track.time_s().to_vec();
    let (from, to) = b.ctx.data.span_s();
    let knots = ((to - from) / 45.0).clamp(5.0, 24.0) as usize;
    for (load, part, words) in [
        (
            Load::Additive,
            0.0,
            "an additive wander of all readings in time",
        ),
        (
            Load::Proportional,
            0.0,
            "the plume's strength wandering in time",
        ),
        (
            Load::Proportional,
            1.0,
            "the source's strength wandering in time",
        ),
        (
            Load::Swing,
            0.5,
            "the plume swinging in time otherwise than the wind",
        ),
    ] {
        let then = b.time_on_the_way(part);
        let columns = b.hats(&then, knots, load);
        b.add("time", words, columns);
    }
    let platforms = b.ctx.data.ranges().len();
    if platforms < 2 {
        return;
    }
    let ln_weight = -(platforms as f64).ln();
    for (load, words) in [
        (Load::Additive, "an additive wander in time"),
        (
            Load::Proportional,
            "the strength of its plume readings wandering in time",
        ),
        (Load::Delay, "a delay of its readings that comes and goes"),
    ] {
        let columns = b.hats(&time, (knots * 2 / 3).max(5), load);
        for p in 0..platforms {
            let name = &b.ctx.data.track.platforms()[p];
            let words = format!("platform {name}: {words}");
            b.add_weighted("platform", words, Some(p), ln_weight, columns.clone());
        }
    }
}

fn in_place(b: &mut Builder<'_>) {
    let track = &b.ctx.data.track;
    let source = b.ctx.setup.base.sources[0].place;
    let n = track.len();
    let (mut along, mut across, mut height) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
    let Some(world) = b.fitted.model.world(&b.ctx.setup.base, track.platforms()) else {
        return;
    };
    for i in 0..n {
        let (p, w) = (track.place(i), track.transport()[i]);
        let (e, no) = (p.east_m - source.east_m, p.north_m - source.north_m);
        along[i] = e * w.east + no * w.north;
        let sigma = world.sigmas_m(along[i].max(10.0)).0;
        across[i] = ((e * w.north - no * w.east) / sigma).clamp(-4.0, 4.0);
        height[i] = p.height_agl_m;
    }
    for (coordinate, at, words) in [
        ("along_wind", &along, "with distance along the wind"),
        ("across_wind", &across, "with distance across the wind"),
        ("height", &height, "with height"),
    ] {
        let columns = b.hats(at, 7, Load::Proportional);
        b.add(
            coordinate,
            &format!("the plume's strength changing {words}"),
            columns,
        );
        let columns = b.hats(at, 7, Load::Additive);
        b.add(coordinate, &format!("readings changing {words}"), columns);
    }
    for (coordinate, at, words) in [
        ("along_wind", &along, "along"),
        ("across_wind", &across, "across"),
    ] {
        let columns = b.hats(at, 13, Load::Proportional);
        let words = format!("the plume's strength changing {words} the wind in narrow strips");
        b.add(coordinate, &words, columns);
    }
    map(b, &along, &across);
}

/// Products of hats east and north, and along and across the wind.
fn map(b: &mut Builder<'_>, along: &[f64], across: &[f64]) {
    let track = &b.ctx.data.track;
    let east: Vec<f64> = (0..track.len()).map(|i| track.place(i).east_m).collect();
    let north: Vec<f64> = (0..track.len()).map(|i| track.place(i).north_m).collect();
    for (load, one, other, sizes, words) in [
        (
            Load::Proportional,
            along,
            across,
            (4, 7),
            "the plume's strength changing over the map",
        ),
        (
            Load::Additive,
            &east,
            &north,
            (5, 5),
            "readings changing over the map",
        ),
    ] {
        let e = b.hats(one, sizes.0, Load::Additive);
        let n = b.hats(other, sizes.1, Load::Additive);
        let mut products = Vec::with_capacity(e.len() * n.len());
        for i in e.clone() {
            for j in n.clone() {
                let column: Vec<f64> = (0..east.len())
                    .map(|r| b.columns[i][r] * b.columns[j][r] * b.load(load, r))
                    .collect();
                products.push(column);
            }
        }
        b.columns.truncate(e.start);
        let start = b.columns.len();
        b.columns.extend(products);
        let all = start..b.columns.len();
        b.add("map", words, all);
    }
}

/// Sines and cosines of periods from 30 s to half the record.
fn periodic(b: &mut Builder<'_>) {
    const COUNT: usize = 20;
    let time = b.ctx.data.track.time_s().to_vec();
    let (from, to) = b.ctx.data.span_s();
    let longest = 0.7 * (to - from);
    let shortest = 30.0f64;
    if longest < 2.0 * shortest {
        return;
    }
    let platforms = b.ctx.data.ranges().len();
    let (emitted, turned) = (b.time_on_the_way(1.0), b.time_on_the_way(0.5));
    for k in 0..COUNT {
        let period = shortest * (longest / shortest).powf(k as f64 / (COUNT - 1) as f64);
        for (load, time, words) in [
            (Load::Additive, &time, "a periodic wave of all readings"),
            (
                Load::Proportional,
                &emitted,
                "the source's strength pulsing",
            ),
            (Load::Swing, &turned, "the plume swinging to and fro"),
        ] {
            let start = b.columns.len();
            for phase in [0.0, std::f64::consts::FRAC_PI_2] {
                let wave = |i: usize| (std::f64::consts::TAU * time[i] / period + phase).sin();
                let column = (0..time.len()).map(|i| wave(i) * b.load(load, i)).collect();
                b.columns.push(column);
            }
            let own = start..b.columns.len();
            let ln_weight = -(COUNT as f64).ln();
            let text = format!("{words}, period about {period:.0} s");
            b.add_weighted("time", text, None, ln_weight, own.clone());
            if load == Load::Additive && platforms > 1 {
                for p in 0..platforms {
                    let name = &b.ctx.data.track.platforms()[p];
                    let text =
                        format!("platform {name}: a periodic wave, period about {period:.0} s");
                    let share = ln_weight - (platforms as f64).ln();
                    b.add_weighted("platform", text, Some(p), share, own.clone());
                }
            }
        }
        delays(b, &time, period, -(COUNT as f64).ln());
    }
}

/// A delay of one platform's readings that comes and goes with a period.
fn delays(b: &mut Builder<'_>, time_s: &[f64], period_s: f64, ln_weight: f64) {
    let platforms = b.ctx.data.ranges().len();
    let start = b.columns.len();
    let phase = |i: usize| std::f64::consts::TAU * time_s[i] / period_s;
    for wave in [|_: f64| 1.0, |p: f64| p.sin(), |p: f64| p.cos()] {
        let column = (0..time_s.len())
            .map(|i| wave(phase(i)) * b.load(Load::Delay, i))
            .collect();
        b.columns.push(column);
    }
    let own = start..b.columns.len();
    for p in 0..platforms {
        let name = &b.ctx.data.track.platforms()[p];
        let text = format!(
            "platform {name}: a delay of its readings that comes and goes, period about \
             {period_s:.0} s"
        );
        let share = ln_weight - (platforms as f64).ln();
        b.add_weighted("platform", text, Some(p), share, own.clone());
    }
}
