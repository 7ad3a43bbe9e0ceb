//! The test that names have to stand which are called for: it carries over to blocks left out, and
//! under a noise of its own gains more than the base at a better place.

use super::fit::{Context, Fitted};
use super::held_out;
use super::model::Model;

/// What an extension must gain under the noise that is fitted with it, nats.
const STANDS_NATS: f64 = 6.0;
/// What fits with noises of their own differ by at most from place to place where the model is
/// as straight as its derivatives, nats.
const STRAIGHT_LINES_NATS: f64 = 30.0;
/// What an extension that changes nothing changes the score by at most, nats.
const IDLE_NATS: f64 = 1.0;

/// What becomes of a name that is called for.
pub(crate) enum Tested {
    /// It does not carry over to blocks left out: a chance of the data.
    Chance,
    /// The null has a better place, and without the name.
    Null(Fitted),
    /// It stands under a noise of its own.
    Extension(Fitted),
}

/// What becomes of names on top of `last`: `with` them under its noise, each one of the `parts`.
pub(crate) fn put_to_the_test(
    ctx: &Context<'_>,
    last: &Fitted,
    with: &Fitted,
    parts: &[usize],
) -> Tested {
    let least = least_on_blocks(&last.model, parts);
    let carries_over = |with: &Fitted| held_out::log_gain(ctx, last, with) >= least;
    let under_nulls_noise = carries_over(with);
    let refined = ctx.refine(&with.model, with.noise);
    // A noise that had to take up a large effect leaves little of it to blocks left out.
    let under_its_own = || much_worse(last, &refined) && carries_over(&refined);
    if !(under_nulls_noise || under_its_own()) {
        return Tested::Chance;
    }
    let null = &last.model;
    // From the last on, so that the others stay where they are.
    let mut last_first = parts.to_vec();
    last_first.sort_unstable_by(|a, b| b.cmp(a));
    let alone = last_first
        .iter()
        .try_fold(refined.model.clone(), |model, part| {
            without(&model, null, *part)
        });
    let Some((alone, settled)) = alone
        .and_then(|alone| null_as_good(ctx, null, &refined, &alone, least).map(|f| (alone, f)))
    else {
        return Tested::Extension(refined);
    };
    let moved = ctx.refine(&settled.model, refined.noise);
    let nulls_worse = much_worse(&moved, &refined) && much_worse(last, &refined);
    if nulls_worse && !does_nothing(ctx, &refined, &alone) {
        return Tested::Extension(refined);
    }
    if much_worse(&moved, last) {
        return Tested::Chance;
    }
    Tested::Null(moved)
}

/// What names must gain at least on blocks left out, nats. A parameter of the base goes as far from
/// its prior as the data pull it, with a wide prior or a narrow one: both predict alike.
fn least_on_blocks(null: &Model, parts: &[usize]) -> f64 {
    let of_the_base = parts.iter().all(|part| *part < null.parts.len());
    if of_the_base { -IDLE_NATS } else { 0.0 }
}

/// Whether a model is all the same `alone`, without one of its parts and with all else unmoved.
fn does_nothing(ctx: &Context<'_>, with: &Fitted, alone: &Model) -> bool {
    let score = |model: &Model| ctx.settle(model, &with.metric, with, 0).log_score;
    (score(&with.model) - score(alone)).abs() < IDLE_NATS
}

/// Whether a fit with its noise is so much less probable than another that only the straight
/// lines of the other, by which swings and tolerances enter, made its place look good.
pub(crate) fn much_worse(fit: &Fitted, than: &Fitted) -> bool {
    fit.score_with_prior() < than.score_with_prior() - STRAIGHT_LINES_NATS
}

/// The null at where an extension moved it, if the extension gains little more than that once the
/// noise is its own, or nothing on blocks left out: its gain was the null's bad place.
fn null_as_good(
    ctx: &Context<'_>,
    null: &Model,
    refined: &Fitted,
    alone: &Model,
    least_nats: f64,
) -> Option<Fitted> {
    let score = |model: &Model| {
        let settled = ctx.settle_in_its_place(model, refined, 6);
        let base = settled.model.ln_departure(|k| k < null.dimension());
        (settled.log_score + base, settled)
    };
    let (with, extended) = score(&refined.model);
    let (alone, settled) = score(alone);
    let stands =
        with - alone > STANDS_NATS && held_out::log_gain(ctx, &settled, &extended) > least_nats;
    (!stands).then_some(settled)
}

/// The model without an extension, or with the base's own prior put back.
pub(crate) fn without(model: &Model, base: &Model, part: usize) -> Option<Model> {
    let mut out = model.clone();
    if part < base.parts.len() {
        for free in out.free.iter_mut().filter(|f| f.part == part) {
            let own = base
                .free
                .iter()
                .find(|f| f.part == part && f.parameter == free.parameter)?;
            (free.sd, free.stated) = (own.sd, own.stated);
        }
        return Some(out);
    }
    out.parts.remove(part);
    out.free.retain(|f| f.part != part);
    for free in out.free.iter_mut().filter(|f| f.part > part) {
        free.part -= 1;
    }
    Some(out)
}
