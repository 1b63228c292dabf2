"""Films and folders of pictures with their times and motion samples, whoever looks at them."""
