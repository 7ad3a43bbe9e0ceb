//! Routes through an airspace, around what stands in the way: a visibility graph and the shortest
//! path on it.

use air::geo::Enu;

use scenario::airspace::Airspace;

/// Via-points of an airspace and which of the legs between them are clear, worked out once.
#[derive(Debug, Clone)]
pub struct RouteGraph {
    margin_m: f64,
    nodes: Vec<Enu>,
    /// Row by row, whether the leg between two nodes is clear.
    clear: Vec<bool>,
}

impl RouteGraph {
    /// The routes that keep `margin_m` of clearance.
    pub fn of(airspace: &Airspace, margin_m: f64) -> Self {
        let nodes = airspace.via_points(margin_m);
        let legs = nodes
            .iter()
            .flat_map(|a| nodes.iter().map(move |b| (*a, *b)));
        let clear = legs
            .map(|(a, b)| airspace.leg_is_clear(a, b, margin_m))
            .collect();
        Self {
            margin_m,
            nodes,
            clear,
        }
    }

    /// A short route from `from` to `to`: the via-points and `to` itself, every leg clear by the
    /// margin (or, on the first leg, by what is left of it at `from`). From a place that is not
    /// allowed, the first via-point is the way out. `None` when `to` does not keep the margin or
    /// nothing leads there.
    pub fn route(&self, airspace: &Airspace, from: Enu, to: Enu) -> Option<Vec<Enu>> {
        if airspace.clearance_m(to) < self.margin_m {
            return None;
        }
        let left_m = airspace.clearance_m(from);
        if left_m < 0.0 {
            let out = airspace.nearest_allowed(from, self.margin_m)?;
            let mut route = vec![out];
            route.extend(self.route(airspace, out, to)?);
            return Some(route);
        }
        // From inside the margin the first leg cannot keep it; it must not come nearer than it is.
        let first_m = self.margin_m.min(left_m - 1e-6).max(0.0);
        if airspace.leg_is_clear(from, to, first_m) {
            return Some(vec![to]);
        }
        let reach = |end: Enu, margin_m: f64| -> Vec<bool> {
            let leg = |node: &Enu| airspace.leg_is_clear(end, *node, margin_m);
            self.nodes.iter().map(leg).collect()
        };
        self.shortest(from, to, &reach(from, first_m), &reach(to, self.margin_m))
    }

    /// Dijkstra (1959) over the via-points, from those in sight of the start to one in sight of
    /// the goal.
    fn shortest(&self, from: Enu, to: Enu, starts: &[bool], ends: &[bool]) -> Option<Vec<Enu>> {
        let count = self.nodes.len();
        let mut before = vec![None; count];
        let mut done = vec![false; count];
        let mut length: Vec<f64> = (0..count)
            .map(|i| {
                if starts[i] {
                    from.distance_m(self.nodes[i])
                } else {
                    f64::INFINITY
                }
            })
            .collect();
        let mut best: Option<(f64, usize)> = None;
        while let Some(next) = (0..count)
            .filter(|&i| !done[i] && length[i].is_finite())
            .min_by(|&a, &b| length[a].total_cmp(&length[b]))
        {
            done[next] = true;
            let whole = length[next] + self.nodes[next].distance_m(to);
            if ends[next] && best.is_none_or(|(shortest, _)| whole < shortest) {
                best = Some((whole, next));
            }
            for other in 0..count {
                let through = length[next] + self.nodes[next].distance_m(self.nodes[other]);
                if self.clear[next * count + other] && !done[other] && through < length[other] {
                    length[other] = through;
                    before[other] = Some(next);
                }
            }
        }
        let mut path = vec![to];
        let mut at = Some(best?.1);
        while let Some(node) = at {
            path.push(self.nodes[node]);
            at = before[node];
        }
        path.reverse();
        Some(path)
    }
}
