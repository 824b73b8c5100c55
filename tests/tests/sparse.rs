//! The core's sparse solver on a factor given as a formula.

use sinew_core::Level;
use sinew_core::solve::sparse::{Factor, FactorError, FactorParts, PADDING, Row4};

/// Two separate blocks (rows 0..5 and 5..7) that both reach into the last one (rows 7..12).
const COLUMNS: [u32; 4] = [0, 5, 7, 12];
const ROWS_BELOW: [&[u32]; 3] = [&[7, 8, 9, 10, 11], &[8, 11], &[]];
const SIZE: usize = 12;

/// `L` as a formula: heavy diagonal, small entries elsewhere, zero outside the pattern.
fn entry(row: usize, column: usize) -> f64 {
    let supernode = COLUMNS.iter().rposition(|&first| first as usize <= column);
    let supernode = supernode.expect("every column has one");
    let end = COLUMNS[supernode + 1] as usize;
    let inside = row < end || ROWS_BELOW[supernode].contains(&(row as u32));
    match row {
        _ if row < column || !inside => 0.0,
        _ if row == column => 2.0 + row as f64 / 8.0,
        _ => ((row * 7 + column * 3) % 11) as f64 / 16.0 - 0.25,
    }
}

struct Arrays {
    panels: Vec<u32>,
    rows: Vec<[u32; 4]>,
    values: Vec<[f32; 4]>,
}

impl Arrays {
    fn parts(&self) -> FactorParts<'_> {
        FactorParts {
            size: SIZE,
            columns: &COLUMNS,
            panels: &self.panels,
            rows: &self.rows,
            values: &self.values,
        }
    }
}

fn pack() -> Arrays {
    let mut arrays = Arrays {
        panels: vec![0],
        rows: Vec::new(),
        values: Vec::new(),
    };
    for (pair, below) in COLUMNS.windows(2).zip(ROWS_BELOW) {
        let (first, end) = (pair[0] as usize, pair[1] as usize);
        for group in (first..end).step_by(4) {
            for column in first..group + 4 {
                let quad = [0, 1, 2, 3].map(|lane| {
                    let row = group + lane;
                    match row {
                        _ if row >= end || column >= end => 0.0,
                        _ if row == column => 1.0 / entry(row, row),
                        _ => entry(row, column),
                    }
                });
                arrays.values.push(quad.map(|x| x as f32));
            }
        }
        for rows in below.chunks(4) {
            let rows = [0, 1, 2, 3].map(|lane| rows.get(lane).copied().unwrap_or(PADDING));
            for column in first..end {
                arrays.values.push(rows.map(|row| match row {
                    PADDING => 0.0,
                    row => entry(row as usize, column) as f32,
                }));
            }
            arrays.rows.push(rows);
        }
        arrays.panels.push(arrays.rows.len() as u32);
    }
    arrays
}

fn truth(row: usize, lane: usize) -> f64 {
    (row as f64 - 5.0) * (lane as f64 + 1.0) / 4.0 + lane as f64
}

/// `L x`, or `L' x`.
fn multiply(x: &[[f64; 4]; SIZE], transposed: bool) -> [[f64; 4]; SIZE] {
    let mut product = [[0.0; 4]; SIZE];
    for row in 0..SIZE {
        for column in 0..=row {
            let (to, from) = if transposed {
                (column, row)
            } else {
                (row, column)
            };
            for lane in 0..4 {
                product[to][lane] += entry(row, column) * x[from][lane];
            }
        }
    }
    product
}

fn systems() -> (Vec<Row4>, Vec<Row4>, Vec<Row4>, [[f64; 4]; SIZE]) {
    let x = std::array::from_fn(|row| std::array::from_fn(|lane| truth(row, lane)));
    let narrow = |rows: [[f64; 4]; SIZE]| rows.iter().map(|row| row.map(|x| x as f32)).collect();
    let upper = multiply(&x, true);
    (
        narrow(multiply(&x, false)),
        narrow(upper),
        narrow(multiply(&upper, false)),
        x,
    )
}

fn worst(found: &[Row4], truth: &[[f64; 4]; SIZE]) -> f64 {
    let pairs = found.as_flattened().iter().zip(truth.as_flattened());
    pairs.fold(0.0, |worst: f64, (&a, &b)| {
        worst.max((f64::from(a) - b).abs())
    })
}

#[test]
fn known_solutions_come_back() {
    let arrays = pack();
    let factor = Factor::new_checked(arrays.parts()).expect("sound");
    let (mut lower, mut upper, mut both, x) = systems();
    factor.solve_lower(&mut lower, Level::best());
    factor.solve_upper(&mut upper, Level::best());
    factor.solve(&mut both, Level::best());
    for found in [lower, upper, both] {
        assert!(worst(&found, &x) < 2e-5, "{}", worst(&found, &x));
    }
    assert_eq!(factor.multiply_adds(), 8 * arrays.values.len());
}

#[test]
fn every_level_gives_the_same_bits() {
    let arrays = pack();
    let factor = Factor::new_checked(arrays.parts()).expect("sound");
    let (_, _, mut one, _) = systems();
    let mut other = one.clone();
    factor.solve(&mut one, Level::Scalar);
    factor.solve(&mut other, Level::best());
    let bits = |rows: &[Row4]| {
        rows.as_flattened()
            .iter()
            .map(|x| x.to_bits())
            .collect::<Vec<_>>()
    };
    assert_eq!(bits(&one), bits(&other));
}

#[test]
fn a_right_hand_side_of_another_length_is_left_alone() {
    let arrays = pack();
    let factor = Factor::new_checked(arrays.parts()).expect("sound");
    let mut x = vec![[1.0; 4]; SIZE - 1];
    factor.solve(&mut x, Level::best());
    assert!(x.iter().all(|row| *row == [1.0; 4]));
}

#[test]
fn an_empty_system_is_sound() {
    let parts = FactorParts {
        size: 0,
        columns: &[0],
        panels: &[0],
        rows: &[],
        values: &[],
    };
    Factor::new_checked(parts)
        .expect("sound")
        .solve(&mut [], Level::best());
}

#[test]
fn each_fault_has_its_own_error() {
    let good = pack();
    let check = |change: &dyn Fn(&mut Vec<u32>, &mut Arrays)| {
        let mut columns = COLUMNS.to_vec();
        let mut arrays = pack();
        change(&mut columns, &mut arrays);
        let parts = FactorParts {
            columns: &columns,
            ..arrays.parts()
        };
        Factor::new_checked(parts).err()
    };
    assert_eq!(check(&|_, _| {}), None);
    let columns = |supernode| Some(FactorError::Columns { supernode });
    assert_eq!(check(&|c, _| c[0] = 1), columns(0));
    assert_eq!(check(&|c, _| c[2] = 5), columns(1));
    assert_eq!(check(&|c, _| c[2] = 13), columns(1));
    assert_eq!(check(&|c, _| c.clear()), columns(0));
    let panels = |supernode| Some(FactorError::Panels { supernode });
    assert_eq!(check(&|_, a| a.panels[1] = 9), panels(0));
    assert_eq!(check(&|_, a| a.panels[1] = u32::MAX), panels(0));
    assert_eq!(check(&|_, a| a.panels.truncate(2)), panels(3));
    let row = |panel, row| Some(FactorError::Row { panel, row });
    assert_eq!(check(&|_, a| a.rows[0][1] = 7), row(0, 7));
    assert_eq!(check(&|_, a| a.rows[0][3] = PADDING), row(0, PADDING));
    assert_eq!(check(&|_, a| a.rows[2][1] = 12), row(2, 12));
    assert_eq!(check(&|_, a| a.rows[2][0] = 6), row(2, 6));
    assert_eq!(check(&|_, a| a.rows[2][0] = PADDING), row(2, PADDING));
    let (needed, found) = (good.values.len(), good.values.len() - 1);
    assert_eq!(
        check(&|_, a| a.values.truncate(found)),
        Some(FactorError::Values { needed, found })
    );
    assert_eq!(
        check(&|_, a| a.values[3][2] = f32::NAN),
        Some(FactorError::Number { quad: 3 })
    );
    let parts = FactorParts {
        size: usize::MAX,
        ..good.parts()
    };
    assert_eq!(
        Factor::new_checked(parts).err(),
        Some(FactorError::Size { size: usize::MAX })
    );
}
