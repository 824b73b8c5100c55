use super::*;

const BLUE: Rgb = SERIES_COLORS[0];
const ORANGE: Rgb = SERIES_COLORS[1];

/// Whether a pixel is at least about half covered by a saturated colour.
fn inked(image: &Image, x: usize, y: usize, color: Rgb) -> bool {
    let pixel = image.pixel(x, y).map(i32::from);
    match color {
        BLUE => pixel[2] - pixel[0] > 70,
        _ => pixel[0] - pixel[2] > 70,
    }
}

/// Columns and rows, exclusive, around all pixels of a colour.
fn extent(image: &Image, color: Rgb) -> Option<[usize; 4]> {
    let mut extent: Option<[usize; 4]> = None;
    for y in 0..image.height {
        for x in 0..image.width {
            if inked(image, x, y, color) {
                let [left, top, right, _] = extent.unwrap_or([x, y, x, y]);
                extent = Some([left.min(x), top, right.max(x + 1), y + 1]);
            }
        }
    }
    extent
}

fn chart(style: Style, points: &[[f64; 2]]) -> Chart {
    Chart {
        series: vec![Series::new("", style, points.to_vec())],
        ..Chart::default()
    }
}

#[test]
fn bars_are_as_high_as_their_values() {
    let chart = Chart {
        series: vec![
            Series::new("", Style::Bars, vec![[0.0, 1.0]]),
            Series::new("", Style::Bars, vec![[0.0, 2.0]]),
        ],
        categories: vec!["only".into()],
        ..Chart::default()
    };
    let image = chart.render(450, 300);
    let [left, top, right, bottom] = extent(&image, BLUE).unwrap();
    let [other_left, other_top, other_right, other_bottom] = extent(&image, ORANGE).unwrap();
    assert_eq!(bottom, other_bottom);
    let ratio = (bottom - other_top) as f64 / (bottom - top) as f64;
    assert!((ratio - 2.0).abs() < 0.05, "{ratio}");
    assert!(
        (other_left as i64 - right as i64).abs() <= 1,
        "side by side"
    );
    assert!(((other_right - other_left) as i64 - (right - left) as i64).abs() <= 1);
}

#[test]
fn a_gap_breaks_the_line() {
    let values = [1.0, 1.0, f64::NAN, 1.0, 1.0];
    let points: Vec<[f64; 2]> = (0..5).map(|x| [x as f64, values[x]]).collect();
    let mut chart = chart(Style::Line, &points);
    chart.y_range = Some([0.0, 2.0]);
    let image = chart.render(400, 200);
    let [left, top, right, bottom] = extent(&image, BLUE).unwrap();
    assert!(bottom - top <= 3);
    let row = (top + bottom) / 2;
    let inked = |x: usize| inked(&image, x, row, BLUE);
    let at = |share: f64| left + ((right - left) as f64 * share) as usize;
    assert!(inked(at(0.1)) && inked(at(0.9)));
    assert!(!inked(at(0.35)) && !inked(at(0.5)) && !inked(at(0.65)));
}

#[test]
fn steps_hold_until_the_next_point() {
    let mut chart = chart(Style::Step, &[[0.0, 0.0], [1.0, 1.0], [2.0, 1.0]]);
    chart.y_range = Some([-1.0, 2.0]);
    let image = chart.render(400, 200);
    let [left, top, right, bottom] = extent(&image, BLUE).unwrap();
    let quarter = left + (right - left) / 4;
    let column: Vec<usize> = (0..200)
        .filter(|&y| inked(&image, quarter, y, BLUE))
        .collect();
    assert!(
        column.iter().all(|&y| y + 4 >= bottom),
        "still at the first value"
    );
    let late = left + (right - left) * 3 / 4;
    assert!((top..top + 4).any(|y| inked(&image, late, y, BLUE)));
}

#[test]
fn many_points_keep_their_extremes() {
    let mut points: Vec<[f64; 2]> = (0..100_000).map(|x| [f64::from(x), 0.0]).collect();
    points[51_234][1] = 5.0;
    let mut chart = chart(Style::Line, &points);
    chart.y_range = Some([-1.0, 6.0]);
    let [_, top, _, bottom] = extent(&chart.render(400, 200), BLUE).unwrap();
    assert!(bottom - top > 80, "the single spike shows");
}

#[test]
fn nonsense_and_tiny_sizes_do_not_panic() {
    let nasty = [f64::NAN, f64::INFINITY, -1e308, 1e308, 0.0, 1e-308];
    let points: Vec<[f64; 2]> = nasty.iter().flat_map(|&x| nasty.map(|y| [x, y])).collect();
    for style in [Style::Line, Style::Step, Style::Bars, Style::Dots] {
        let mut chart = chart(style, &points);
        chart.title = "A title that is much too long for the picture".into();
        chart.y_label = "height".into();
        for (width, height) in [(0, 0), (1, 1), (30, 20), (200, 100)] {
            let image = chart.render(width, height);
            assert_eq!(image.rgb.len(), width * height * 3);
        }
        chart.x_range = Some([f64::NAN, 3.0]);
        chart.y_range = Some([2.0, 2.0]);
        let _ = chart.render(200, 100);
    }
    let _ = Chart::default().render(200, 100);
}

#[test]
fn timeline_shows_spans_at_their_place() {
    let row = |name: &str, spans: &[[f64; 2]]| TimelineRow {
        name: name.into(),
        spans: spans.to_vec(),
    };
    let timeline = Timeline {
        rows: vec![
            row("a", &[[0.0, 5.0]]),
            row("b", &[[5.0, 10.0], [f64::NAN, 1.0]]),
            row("c", &[]),
        ],
        x_range: Some([0.0, 10.0]),
        ..Timeline::default()
    };
    let image = timeline.render(450, 120);
    let spans: Vec<usize> = (0..450)
        .filter(|&x| (0..120).any(|y| inked(&image, x, y, ORANGE)))
        .collect();
    let (first, last) = (spans[0], spans[spans.len() - 1]);
    let middle = (first + last) / 2;
    let rows = |x: usize| (0..120).filter(|&y| inked(&image, x, y, ORANGE)).min();
    assert!(
        rows(middle - 5).unwrap() < rows(middle + 5).unwrap(),
        "b is below a"
    );
    assert_eq!(Timeline::default().render(0, 0).rgb.len(), 0);
    let _ = Timeline::default().render(300, 100);
}
