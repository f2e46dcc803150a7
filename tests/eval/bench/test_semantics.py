from eval.bench.semantics import bench_semantics, room_map


def test_a_map_has_as_many_planes_as_asked_and_rooms_that_are_found():
    planes = room_map(40)
    assert [plane.id for plane in planes] == list(range(40))
    rows = bench_semantics((40,), repeats=2)
    assert [row.case for row in rows] == ["everything new", "one keyframe", "everything moved"]
    assert all(row.planes == 40 and row.wall_ms > 0.0 and row.cpu_ms > 0.0 for row in rows)
