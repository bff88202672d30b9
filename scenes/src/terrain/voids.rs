//! Filling what was not measured.
//!
//! Voids take the shape of a membrane: each filled height is the mean of its four neighbours (Laplace's equation,
//! in cells), held by the measured heights around the hole and free at the border of the grid. Solved from coarse
//! to fine: a pyramid of means gives each level its start, sweeps do the rest.
//!
//! Based on: Gortler et al., The Lumigraph, 1996 (pull-push); Bornemann & Deuflhard, The cascadic multigrid
//! method, 1996. A membrane has no ridges or valleys of its own: a large hole comes out as a smooth dish.

/// Sweeps of a level. Starting from the coarser level, 16 leave under 1 % of a hole's relief.
const SWEEPS: usize = 16;

/// How many heights were void, and how many of those hang together with the border of the grid.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Filled {
    pub voids: usize,
    pub at_border: usize,
}

/// Fills all NaN; `None` if there is nothing else.
pub fn fill(columns: usize, rows: usize, height: &mut [f32]) -> Option<Filled> {
    let voids: Vec<usize> = (0..height.len()).filter(|&i| height[i].is_nan()).collect();
    if voids.len() == height.len() {
        return None;
    }
    let at_border = count_at_border(columns, rows, height);
    if !voids.is_empty() {
        fill_level(columns, rows, height, &voids);
    }
    Some(Filled { voids: voids.len(), at_border })
}

fn fill_level(columns: usize, rows: usize, height: &mut [f32], voids: &[usize]) {
    let (half_columns, half_rows) = (columns.div_ceil(2), rows.div_ceil(2));
    let mut coarse = halve(columns, rows, height);
    let coarse_voids: Vec<usize> = (0..coarse.len()).filter(|&i| coarse[i].is_nan()).collect();
    if !coarse_voids.is_empty() {
        fill_level(half_columns, half_rows, &mut coarse, &coarse_voids);
    }
    for &i in voids {
        height[i] = between(half_columns, half_rows, &coarse, i % columns, i / columns);
    }
    for sweep in 0..SWEEPS {
        // Forth and back, so that neither end lags behind.
        let relax = |&i: &usize| height[i] = neighbour_mean(columns, rows, height, i);
        if sweep % 2 == 0 { voids.iter().for_each(relax) } else { voids.iter().rev().for_each(relax) }
    }
}

/// Means of two by two, of what is not void.
fn halve(columns: usize, rows: usize, height: &[f32]) -> Vec<f32> {
    let (half_columns, half_rows) = (columns.div_ceil(2), rows.div_ceil(2));
    let mut coarse = Vec::with_capacity(half_columns * half_rows);
    for r in 0..half_rows {
        for c in 0..half_columns {
            let (mut sum, mut n) = (0.0, 0.0);
            for row in 2 * r..(2 * r + 2).min(rows) {
                for column in 2 * c..(2 * c + 2).min(columns) {
                    let h = height[row * columns + column];
                    if !h.is_nan() {
                        (sum, n) = (sum + h, n + 1.0);
                    }
                }
            }
            // 0 / 0: void where all are.
            coarse.push(sum / n);
        }
    }
    coarse
}

/// The coarse level at a place of the fine one, linear between its cells.
fn between(columns: usize, rows: usize, coarse: &[f32], x: usize, y: usize) -> f32 {
    let place = |i: usize, n: usize| {
        let at = ((i as f32 - 0.5) * 0.5).clamp(0.0, (n - 1) as f32);
        let low = at as usize;
        (low, (low + 1).min(n - 1), at - low as f32)
    };
    let ((x0, x1, u), (y0, y1, v)) = (place(x, columns), place(y, rows));
    let row = |y: usize| coarse[y * columns + x0] * (1.0 - u) + coarse[y * columns + x1] * u;
    row(y0) * (1.0 - v) + row(y1) * v
}

fn neighbour_mean(columns: usize, rows: usize, height: &[f32], i: usize) -> f32 {
    let (x, y) = (i % columns, i / columns);
    let sides =
        [(x > 0, -1), (x + 1 < columns, 1), (y > 0, -(columns as isize)), (y + 1 < rows, columns as isize)];
    let inside = sides.iter().filter(|(inside, _)| *inside);
    let (sum, n) =
        inside.fold((0.0, 0.0), |(sum, n), (_, step)| (sum + height[i.wrapping_add_signed(*step)], n + 1.0));
    sum / n
}

/// Voids that a path of voids joins to the border.
fn count_at_border(columns: usize, rows: usize, height: &[f32]) -> usize {
    let mut seen = vec![false; height.len()];
    let border = (0..columns).flat_map(|x| [x, (rows - 1) * columns + x]);
    let border = border.chain((0..rows).flat_map(|y| [y * columns, (y + 1) * columns - 1]));
    let mut stack: Vec<usize> = border.filter(|&i| height[i].is_nan()).collect();
    let mut count = 0;
    while let Some(i) = stack.pop() {
        if std::mem::replace(&mut seen[i], true) {
            continue;
        }
        count += 1;
        let (x, y) = (i % columns, i / columns);
        let sides = [
            (x > 0, i.wrapping_sub(1)),
            (x + 1 < columns, i + 1),
            (y > 0, i.wrapping_sub(columns)),
            (y + 1 < rows, i + columns),
        ];
        stack.extend(
            sides.iter().filter(|&&(inside, j)| inside && height[j].is_nan() && !seen[j]).map(|s| s.1),
        );
    }
    count
}
