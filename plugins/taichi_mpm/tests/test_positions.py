"""What Taichi says of a mistake in a kernel: where it is, without a drawing of every node there is."""

from gasp_taichi_mpm.positions import tell_positions_in_a_line
from gasp_taichi_mpm.runtime import taichi


def test_a_mistake_in_a_kernel_of_others_is_drawn_and_one_of_ours_has_its_line(monkeypatch):
    from gasp_taichi_mpm import positions
    from taichi.lang.ast.ast_transformer_utils import ASTTransformerContext

    class Function:
        func = staticmethod(taichi.init)

    class Node:
        lineno = end_lineno = 2
        col_offset, end_col_offset = 4, 7

    context = ASTTransformerContext.__new__(ASTTransformerContext)
    context.func, context.src, context.indent, context.lineno_offset = Function, ["def f():", "    abc = 1"], 0, 40
    context.file = str(positions.Path(__file__))
    head = f'File "{context.file}", line 42, in init:\n'
    assert context.get_pos_info(Node) == head + "    abc = 1\n    ^^^\n"
    monkeypatch.setattr(positions, "_OURS", str(positions.Path(__file__).parent))
    assert context.get_pos_info(Node) == head


def test_a_class_that_draws_nothing_is_left_as_it_is_and_none_is_changed_twice():
    class Other:
        pass

    tell_positions_in_a_line(Other)
    assert not hasattr(Other, "get_pos_info")

    class Drawing:
        def get_pos_info(self, node):
            return "drawn"

    tell_positions_in_a_line(Drawing)
    once = Drawing.get_pos_info
    tell_positions_in_a_line(Drawing)
    assert Drawing.get_pos_info is once
