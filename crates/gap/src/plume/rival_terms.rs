//! The columns of the nameless terms: hats and waves in time, place and across the plume.

use super::delay::{LATE_S, late, rate_of_change};
use super::fit::{Context, Fitted};
use super::lee::{self, Ground};

/// Information of all readings on the plume's strength, as a part of it, below which it does not
/// show: it would have to be seven times as strong for 20 nats.
const LEAST_TOLD: f64 = 1.0;

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
    /// What a reading that comes late differs by: by one of [`LATE_S`].
    Late(usize),
}

impl Load {
    /// How readings are delayed.
    const DELAYS: [Self; 1 + LATE_S.len()] =
        [Self::Delay, Self::Late(0), Self::Late(1), Self::Late(2)];

    /// A delay in words.
    fn delay_words(self) -> String {
        match self {
            Self::Late(k) => format!(
                "a delay of its readings, by about {} s, that comes and goes",
                LATE_S[k]
            ),
            _ => "a delay of its readings that comes and goes".to_string(),
        }
    }
}

/// When what a term describes happens to the air of a reading.
#[derive(Debug, Clone, Copy, PartialEq)]
enum When {
    /// As it is read.
    Read,
    /// As it is emitted.
    Emitted,
    /// As the wind turns it: all the way from the source where puffs are carried, at once where
    /// the plume is straight.
    Turned,
}

/// From where to where a term's function is averaged.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Stretch {
    from: f64,
    to: f64,
}

impl Stretch {
    fn at(place: f64) -> Self {
        Self {
            from: place,
            to: place,
        }
    }

    fn middle(&self) -> f64 {
        0.5 * (self.from + self.to)
    }

    /// The pieces that sorted `knots` cut it into, each as its share and its middle: there a
    /// function that is straight between knots has its mean.
    fn between(self, knots: &[f64]) -> impl Iterator<Item = (f64, f64)> {
        let first = knots.partition_point(|k| *k <= self.from);
        let end = knots.partition_point(|k| *k < self.to).max(first);
        let length = self.to - self.from;
        let mut last = self.from;
        let ends = knots[first..end].iter().copied();
        ends.chain(std::iter::once(self.to)).map(move |next| {
            let piece = next - last;
            let middle = 0.5 * (last + next);
            last = next;
            (if length > 0.0 { piece / length } else { 1.0 }, middle)
        })
    }

    /// Mean of sin(2π t / `period` + `phase`) over it.
    fn mean_wave(&self, period: f64, phase: f64) -> f64 {
        let half = std::f64::consts::PI * (self.to - self.from) / period;
        let left = if half > 1e-6 { half.sin() / half } else { 1.0 };
        left * (std::f64::consts::TAU * self.middle() / period + phase).sin()
    }
}

/// A flexible term.
#[derive(Debug, Clone)]
pub(crate) struct Term {
    pub coordinate: &'static str,
    pub words: String,
    pub platform: Option<usize>,
    /// Whether it turns the plume.
    pub turns: bool,
    /// Whether it swings it to and fro.
    pub swings: bool,
    /// Whether it delays readings.
    pub delays: bool,
    /// Log of its share of the rivals' prior.
    pub ln_weight: f64,
    /// Positions of its columns.
    pub columns: std::ops::Range<usize>,
}

/// Columns as they are made, before whitening.
struct Builder<'a> {
    ctx: &'a Context<'a>,
    fitted: &'a Fitted,
    /// The whitened residual that the base leaves.
    left: &'a [f64],
    delay: Vec<f64>,
    /// What each of [`LATE_S`] does to the readings.
    late: [Vec<f64>; LATE_S.len()],
    /// Inverse standard deviation of each row beside those before it.
    precise: Vec<f64>,
    /// Whether the predicted plume shows at all: what does not has no strength that could change.
    plume_shows: bool,
    columns: Vec<Vec<f64>>,
    terms: Vec<Term>,
}

impl<'a> Builder<'a> {
    fn load(&self, load: Load, i: usize) -> f64 {
        match load {
            Load::Additive => 1.0,
            Load::Proportional if self.plume_shows => self.fitted.loading[i].gust,
            Load::Proportional => 0.0,
            Load::Swing => self.fitted.loading[i].swing,
            Load::Delay => self.delay[i],
            Load::Late(k) => self.late[k][i],
        }
    }

    /// Whether puffs are carried, so that a turn at once is another than one all the way.
    fn carried(&self) -> bool {
        self.ctx.data.track.wind_age_s().iter().any(|a| *a > 0.0)
    }

    /// The times that count at each row, s.
    fn times(&self, when: When) -> Vec<Stretch> {
        let carried = self.carried();
        self.ctx
            .way_s()
            .zip(self.ctx.data.track.time_s())
            .map(|(way_s, &t)| match when {
                When::Emitted => Stretch::at(t - way_s),
                When::Turned if carried => Stretch {
                    from: t - way_s,
                    to: t,
                },
                When::Read | When::Turned => Stretch::at(t),
            })
            .collect()
    }

    /// Hat functions over `at` (one value a row) times the load.
    fn hats(&mut self, at: &[f64], knots: usize, load: Load) -> std::ops::Range<usize> {
        let at: Vec<Stretch> = at.iter().copied().map(Stretch::at).collect();
        self.mean_hats(&at, knots, load)
    }

    /// Hat functions in their mean over a stretch (one a row) times the load.
    fn mean_hats(&mut self, over: &[Stretch], knots: usize, load: Load) -> std::ops::Range<usize> {
        let start = self.columns.len();
        let middle: Vec<f64> = over.iter().map(Stretch::middle).collect();
        let knots = self.knots(&middle, knots, load);
        if knots.len() < 2 {
            return start..start;
        }
        let mut columns = vec![vec![0.0; over.len()]; knots.len()];
        for (i, stretch) in over.iter().enumerate() {
            let load = self.load(load, i);
            for (share, u) in stretch.between(&knots) {
                let k = knots.partition_point(|x| *x <= u).clamp(1, knots.len() - 1);
                let part = ((u - knots[k - 1]) / (knots[k] - knots[k - 1])).clamp(0.0, 1.0);
                columns[k - 1][i] += (1.0 - part) * share * load;
                columns[k][i] += part * share * load;
            }
        }
        self.columns.extend(columns);
        start..self.columns.len()
    }

    /// Knots at even shares of the information that the load gives: where gusts go with the plume
    /// its middle tells little more than its skirts.
    fn knots(&self, at: &[f64], count: usize, load: Load) -> Vec<f64> {
        let mut order: Vec<usize> = (0..at.len()).filter(|i| self.ctx.data.used[*i]).collect();
        order.sort_by(|a, b| at[*a].total_cmp(&at[*b]));
        let told = |i: usize| (self.load(load, i) * self.precise[i]).powi(2);
        let total: f64 = order.iter().map(|i| told(*i)).sum();
        if total <= 0.0 || order.is_empty() {
            return Vec::new();
        }
        let (mut sum, mut out) = (0.0, Vec::with_capacity(count));
        for i in order {
            let due = total * out.len() as f64 / (count - 1) as f64;
            sum += told(i);
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
                turns: false,
                swings: false,
                delays: false,
                ln_weight,
                columns,
            });
        }
    }

    /// Tells of the term of some columns, if it was added last, that it delays readings.
    fn delays(&mut self, columns: std::ops::Range<usize>, load: Load) {
        let last = self.terms.last_mut();
        if let Some(term) = last.filter(|t| t.columns == columns && Load::DELAYS.contains(&load)) {
            term.delays = true;
        }
    }

    /// Tells of the term of some columns, if it was added last, that it turns the plume, and
    /// whether to and fro.
    fn turns(&mut self, columns: std::ops::Range<usize>, swings: bool) {
        let last = self.terms.last_mut();
        if let Some(term) = last.filter(|t| t.columns == columns) {
            (term.turns, term.swings) = (true, swings);
        }
    }
}

/// All columns on top of `fitted`, before whitening, and the terms that they belong to; `left` is
/// the whitened residual that the base leaves.
pub(crate) fn all(ctx: &Context<'_>, fitted: &Fitted, left: &[f64]) -> (Vec<Vec<f64>>, Vec<Term>) {
    let precise = fitted.metric.whitener.scales();
    let rows = (0..ctx.data.len()).filter(|i| ctx.data.used[*i]);
    let told = rows.map(|i| (fitted.prediction.plume[i] * precise[i]).powi(2));
    let mut b = Builder {
        ctx,
        fitted,
        left,
        delay: rate_of_change(ctx, fitted),
        late: LATE_S.map(|s| late(ctx, fitted, s)),
        plume_shows: told.sum::<f64>() > LEAST_TOLD,
        precise,
        columns: Vec::new(),
        terms: Vec::new(),
    };
    in_time(&mut b);
    in_place(&mut b);
    periodic(&mut b);
    (b.columns, b.terms)
}

fn in_time(b: &mut Builder<'_>) {
    let time = b.ctx.data.track.time_s().to_vec();
    let (from, to) = b.ctx.data.span_s();
    let knots = ((to - from) / 45.0).clamp(5.0, 24.0) as usize;
    for (load, when, words) in [
        (
            Load::Additive,
            When::Read,
            "an additive wander of all readings in time",
        ),
        (
            Load::Proportional,
            When::Read,
            "the plume's strength wandering in time",
        ),
        (
            Load::Proportional,
            When::Emitted,
            "the source's strength wandering in time",
        ),
    ] {
        let columns = b.mean_hats(&b.times(when), knots, load);
        b.add("time", words, columns);
    }
    for (load, when, words) in swings(b, ["the plume swinging", "the plume swinging at once"]) {
        let columns = b.mean_hats(&b.times(when), knots, load);
        let words = format!("{words} in time otherwise than the wind");
        b.add("time", &words, columns.clone());
        b.turns(columns, false);
    }
    let platforms = b.ctx.data.ranges().len();
    if platforms < 2 {
        return;
    }
    let ln_weight = -(platforms as f64).ln();
    let own = [
        (Load::Additive, "an additive wander in time"),
        (
            Load::Proportional,
            "the strength of its plume readings wandering in time",
        ),
    ]
    .map(|(load, words)| (load, words.to_string()));
    let delays = Load::DELAYS.map(|load| (load, load.delay_words()));
    for (load, words) in own.into_iter().chain(delays) {
        let columns = b.hats(&time, (knots * 2 / 3).max(5), load);
        for p in 0..platforms {
            let name = &b.ctx.data.track.platforms()[p];
            let words = format!("platform {name}: {words}");
            b.add_weighted("platform", words, Some(p), ln_weight, columns.clone());
            b.delays(columns.clone(), load);
        }
    }
}

/// When the plume may swing: as the wind turns it, and, where that is all the way of its puffs, at
/// once too, each with its `words`. That a wind which nobody logged swings is no finding.
fn swings<'w>(b: &Builder<'_>, words: [&'w str; 2]) -> Vec<(Load, When, &'w str)> {
    if !b.ctx.data.on_board_wind {
        return Vec::new();
    }
    let mut out = vec![(Load::Swing, When::Turned, words[0])];
    if b.carried() {
        out.push((Load::Swing, When::Read, words[1]));
    }
    out
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
    over_the_ground(b);
    over_the_map(b);
}

/// Columns that change the plume's strength from some distance along the mean wind on, on a strip
/// of ground, as it does behind what stands in its way.
fn over_the_ground(b: &mut Builder<'_>) {
    const SIZES: (usize, usize) = (6, 9);
    let ground = Ground::new(b.ctx);
    let (along, across) = (&ground.along_m, &ground.across_m);
    let start = b.columns.len();
    let far = b.hats(along, SIZES.0, Load::Additive);
    let wide = b.hats(across, SIZES.1, Load::Additive);
    let mut strips = Vec::with_capacity(far.len() * wide.len());
    for j in wide {
        let mut behind = vec![0.0; along.len()];
        for i in far.clone().rev() {
            for (r, sum) in behind.iter_mut().enumerate() {
                *sum += b.columns[i][r] * b.columns[j][r] * b.load(Load::Proportional, r);
            }
            strips.push(behind.clone());
        }
    }
    b.columns.truncate(start);
    b.columns.extend(strips);
    let all = start..b.columns.len();
    b.add("map", "the plume's strength changing over the map", all);
    let (lees, tried) = lee::search(b.ctx, b.fitted, b.left, &ground);
    for lee in lees {
        let share = |i: usize| lee.share(ground.along_m[i], ground.across_m[i]);
        let column = (0..b.left.len()).map(|i| share(i) * b.load(Load::Proportional, i));
        let own = b.columns.len();
        b.columns.push(column.collect());
        let words = "the plume's strength changing behind something on the ground".to_string();
        b.add_weighted("map", words, None, -(tried as f64).ln(), own..own + 1);
    }
}

/// Products of hats east and north.
fn over_the_map(b: &mut Builder<'_>) {
    const SIZE: usize = 5;
    let track = &b.ctx.data.track;
    let (east, north): (Vec<f64>, Vec<f64>) = (0..track.len())
        .map(|i| (track.place(i).east_m, track.place(i).north_m))
        .unzip();
    let start = b.columns.len();
    let east = b.hats(&east, SIZE, Load::Additive);
    let north = b.hats(&north, SIZE, Load::Additive);
    let mut products = Vec::with_capacity(east.len() * north.len());
    for i in east {
        for j in north.clone() {
            let both = b.columns[i].iter().zip(&b.columns[j]);
            products.push(both.map(|(e, n)| e * n).collect());
        }
    }
    b.columns.truncate(start);
    b.columns.extend(products);
    let all = start..b.columns.len();
    b.add("map", "readings changing over the map", all);
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
    let mut waves = vec![
        (
            Load::Additive,
            When::Read,
            "a periodic wave of all readings",
        ),
        (
            Load::Proportional,
            When::Emitted,
            "the source's strength pulsing",
        ),
    ];
    let swinging = [
        "the plume swinging to and fro",
        "the plume swinging to and fro at once",
    ];
    waves.extend(swings(b, swinging));
    let over: Vec<Vec<Stretch>> = waves.iter().map(|w| b.times(w.1)).collect();
    for k in 0..COUNT {
        let period = shortest * (longest / shortest).powf(k as f64 / (COUNT - 1) as f64);
        let ln_weight = -(COUNT as f64).ln();
        for (&(load, _, words), over) in waves.iter().zip(&over) {
            let start = b.columns.len();
            for phase in [0.0, std::f64::consts::FRAC_PI_2] {
                let wave = |(i, s): (usize, &Stretch)| s.mean_wave(period, phase) * b.load(load, i);
                let column = over.iter().enumerate().map(wave).collect();
                b.columns.push(column);
            }
            let own = start..b.columns.len();
            let text = format!("{words}, period about {period:.0} s");
            b.add_weighted("time", text, None, ln_weight, own.clone());
            if load == Load::Swing {
                b.turns(own.clone(), true);
            }
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
        for load in Load::DELAYS {
            delays(b, load, &time, period, ln_weight);
        }
    }
}

/// A delay of one platform's readings that comes and goes with a period.
fn delays(b: &mut Builder<'_>, load: Load, time_s: &[f64], period_s: f64, ln_weight: f64) {
    let platforms = b.ctx.data.ranges().len();
    let start = b.columns.len();
    let phase = |i: usize| std::f64::consts::TAU * time_s[i] / period_s;
    for wave in [|_: f64| 1.0, |p: f64| p.sin(), |p: f64| p.cos()] {
        let column = (0..time_s.len())
            .map(|i| wave(phase(i)) * b.load(load, i))
            .collect();
        b.columns.push(column);
    }
    let own = start..b.columns.len();
    // What sets one platform apart is not to be seen on it alone.
    let coordinate = if platforms > 1 { "platform" } else { "time" };
    for p in 0..platforms {
        let name = &b.ctx.data.track.platforms()[p];
        let text = format!(
            "platform {name}: {}, period about {period_s:.0} s",
            load.delay_words()
        );
        let share = ln_weight - (platforms as f64).ln();
        b.add_weighted(coordinate, text, Some(p), share, own.clone());
        b.delays(own.clone(), load);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Mean of a function over a stretch by the midpoint rule in 100,000 steps.
    fn mean_by_steps(s: Stretch, f: impl Fn(f64) -> f64) -> f64 {
        let n = 100_000;
        let at = |k: usize| s.from + (s.to - s.from) * (k as f64 + 0.5) / n as f64;
        (0..n).map(|k| f(at(k))).sum::<f64>() / n as f64
    }

    const STRETCH: Stretch = Stretch {
        from: -3.0,
        to: 17.5,
    };

    #[test]
    fn pieces_give_the_mean_of_what_is_straight_between_knots() {
        let knots = [-10.0, 0.0, 4.0, 9.0, 30.0];
        // Straight between the knots, with corners at 0 and 9.
        let f = |x: f64| (x - 9.0).max(0.0) - 0.3 * x.min(0.0);
        let mean: f64 = STRETCH.between(&knots).map(|(share, u)| share * f(u)).sum();
        assert!((mean - mean_by_steps(STRETCH, f)).abs() < 1e-6, "{mean}");
        let whole: f64 = STRETCH.between(&knots).map(|p| p.0).sum();
        assert!((whole - 1.0).abs() < 1e-12);
        let point: Vec<_> = Stretch::at(4.0).between(&knots).collect();
        assert_eq!(point, [(1.0, 4.0)]);
    }

    #[test]
    fn a_wave_is_damped_by_the_length_of_its_stretch() {
        let wave = |x: f64| (std::f64::consts::TAU * x / 13.0 + 0.7).sin();
        let mean = STRETCH.mean_wave(13.0, 0.7);
        assert!((mean - mean_by_steps(STRETCH, wave)).abs() < 1e-6, "{mean}");
        assert!((Stretch::at(5.0).mean_wave(13.0, 0.7) - wave(5.0)).abs() < 1e-12);
    }
}
