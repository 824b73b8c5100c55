//! Forward and backward substitution over supernodes.

use super::quad::Quad;
use super::{FactorParts, Row4, triangle_quads};

#[cfg(feature = "simd")]
#[inline(always)]
pub(super) fn run_simd<S: fearless_simd::Simd>(
    simd: S,
    parts: &FactorParts<'_>,
    x: &mut [Row4],
    lower: bool,
    upper: bool,
) {
    run::<fearless_simd::f32x4<S>>(simd, parts, x, lower, upper);
}

#[inline(always)]
pub(super) fn run<Q: Quad>(
    token: Q::Token,
    parts: &FactorParts<'_>,
    x: &mut [Row4],
    lower: bool,
    upper: bool,
) {
    if lower {
        forward::<Q>(token, parts, x);
    }
    if upper {
        backward::<Q>(token, parts, x);
    }
}

/// First column, one past the last, and the panels' rows of each supernode.
#[inline(always)]
fn supernodes<'a>(
    parts: &FactorParts<'a>,
) -> impl DoubleEndedIterator<Item = (usize, usize, &'a [[u32; 4]])> {
    let rows = parts.rows;
    let ends = parts.columns.get(1..).unwrap_or_default();
    let panel_ends = parts.panels.get(1..).unwrap_or_default();
    let columns = parts.columns.iter().zip(ends);
    let panels = parts.panels.iter().zip(panel_ends);
    columns
        .zip(panels)
        .map(move |((&first, &end), (&panel, &panel_end))| {
            let rows = rows.get(panel as usize..panel_end as usize);
            (first as usize, end as usize, rows.unwrap_or_default())
        })
}

/// Own rows of a supernode and all rows below it.
#[inline(always)]
fn own_and_below(x: &mut [Row4], first: usize, end: usize) -> Option<(&mut [Row4], &mut [Row4])> {
    let (above, below) = x.split_at_mut_checked(end)?;
    Some((above.get_mut(first..)?, below))
}

#[inline(always)]
fn forward<Q: Quad>(token: Q::Token, parts: &FactorParts<'_>, x: &mut [Row4]) {
    let mut values = parts.values;
    for (first, end, rows) in supernodes(parts) {
        let width = end - first;
        let Some((triangle, rest)) = values.split_at_checked(triangle_quads(width)) else {
            return;
        };
        let Some((panels, rest)) = rest.split_at_checked(width * rows.len()) else {
            return;
        };
        values = rest;
        let Some((own, below)) = own_and_below(x, first, end) else {
            return;
        };
        solve_triangle::<Q>(token, triangle, own);
        for (rows, quads) in rows.iter().zip(panels.chunks_exact(width.max(1))) {
            let mut sums = load_rows::<Q>(token, below, rows, end);
            for (&[a, b, c, d], &x) in quads.iter().zip(&*own) {
                let x = Q::load(token, x);
                let [s, t, u, v] = sums;
                sums = [s.less(a, x), t.less(b, x), u.less(c, x), v.less(d, x)];
            }
            for (&row, sum) in rows.iter().zip(sums) {
                if let Some(to) = below.get_mut((row as usize).wrapping_sub(end)) {
                    *to = sum.to_array();
                }
            }
        }
    }
}

#[inline(always)]
fn backward<Q: Quad>(token: Q::Token, parts: &FactorParts<'_>, x: &mut [Row4]) {
    let mut values = parts.values;
    for (first, end, rows) in supernodes(parts).rev() {
        let width = end - first;
        let Some(at) = values.len().checked_sub(width * rows.len()) else {
            return;
        };
        let Some((rest, panels)) = values.split_at_checked(at) else {
            return;
        };
        let Some(at) = rest.len().checked_sub(triangle_quads(width)) else {
            return;
        };
        let Some((rest, triangle)) = rest.split_at_checked(at) else {
            return;
        };
        values = rest;
        let Some((own, below)) = own_and_below(x, first, end) else {
            return;
        };
        for (rows, quads) in rows.iter().zip(panels.chunks_exact(width.max(1))).rev() {
            let sums = load_rows::<Q>(token, below, rows, end);
            subtract_transposed(token, quads, sums, own);
        }
        solve_transposed_triangle::<Q>(token, triangle, own);
    }
}

/// Rows of a panel; zero for padding.
#[inline(always)]
fn load_rows<Q: Quad>(token: Q::Token, below: &[Row4], rows: &[u32; 4], end: usize) -> [Q; 4] {
    rows.map(|row| {
        let row = below.get((row as usize).wrapping_sub(end));
        Q::load(token, row.copied().unwrap_or_default())
    })
}

/// `own[column] -= sum_row quads[column][row] * x[row]`.
#[inline(always)]
fn subtract_transposed<Q: Quad>(token: Q::Token, quads: &[[f32; 4]], x: [Q; 4], own: &mut [Row4]) {
    let [p, q, r, s] = x;
    for (&[a, b, c, d], own) in quads.iter().zip(own) {
        // Two short sums instead of a long one: each addition waits for the one before it.
        let sum = p.scale(a).add(q.scale(b)).add(r.scale(c).add(s.scale(d)));
        *own = Q::load(token, *own).sub(sum).to_array();
    }
}

/// `T x = b` for the triangle of a supernode.
#[inline(always)]
fn solve_triangle<Q: Quad>(token: Q::Token, triangle: &[[f32; 4]], own: &mut [Row4]) {
    let mut triangle = triangle;
    for first in (0..own.len()).step_by(4) {
        let Some((before, rest)) = triangle.split_at_checked(first) else {
            return;
        };
        let Some((corner, rest)) = rest.split_first_chunk::<4>() else {
            return;
        };
        triangle = rest;
        let Some((solved, group)) = own.split_at_mut_checked(first) else {
            return;
        };
        let [mut s, mut t, mut u, mut v] = load_group::<Q>(token, group);
        for (&[a, b, c, d], &x) in before.iter().zip(&*solved) {
            let x = Q::load(token, x);
            (s, t, u, v) = (s.less(a, x), t.less(b, x), u.less(c, x), v.less(d, x));
        }
        let &[[i, b, c, d], [_, j, f, g], [_, _, k, h], [_, _, _, l]] = corner;
        s = s.scale(i);
        t = t.less(b, s).scale(j);
        u = u.less(c, s).less(f, t).scale(k);
        v = v.less(d, s).less(g, t).less(h, u).scale(l);
        store_group(group, [s, t, u, v]);
    }
}

/// `T' x = b` for the triangle of a supernode.
#[inline(always)]
fn solve_transposed_triangle<Q: Quad>(token: Q::Token, triangle: &[[f32; 4]], own: &mut [Row4]) {
    let mut triangle = triangle;
    for first in (0..own.len()).step_by(4).rev() {
        let Some((rest, corner)) = triangle.split_last_chunk::<4>() else {
            return;
        };
        let Some(at) = rest.len().checked_sub(first) else {
            return;
        };
        let Some((rest, before)) = rest.split_at_checked(at) else {
            return;
        };
        triangle = rest;
        let Some((others, group)) = own.split_at_mut_checked(first) else {
            return;
        };
        let [mut s, mut t, mut u, mut v] = load_group::<Q>(token, group);
        let &[[i, b, c, d], [_, j, f, g], [_, _, k, h], [_, _, _, l]] = corner;
        v = v.scale(l);
        u = u.less(h, v).scale(k);
        t = t.less(f, u).less(g, v).scale(j);
        s = s.less(b, t).less(c, u).less(d, v).scale(i);
        store_group(group, [s, t, u, v]);
        subtract_transposed(token, before, [s, t, u, v], others);
    }
}

#[inline(always)]
fn load_group<Q: Quad>(token: Q::Token, group: &[Row4]) -> [Q; 4] {
    [0, 1, 2, 3].map(|row| Q::load(token, group.get(row).copied().unwrap_or_default()))
}

#[inline(always)]
fn store_group<Q: Quad>(group: &mut [Row4], rows: [Q; 4]) {
    for (to, row) in group.iter_mut().zip(rows) {
        *to = row.to_array();
    }
}
